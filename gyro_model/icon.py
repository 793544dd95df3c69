"""The icon of the FMUs: a mass between springs along two axes, and the turn of the package. One list of shapes, drawn
as SVG and as PNG."""

import struct
import zlib
from typing import Final, NamedTuple

import numpy as np

SIZE: Final = 128
"""Pixels, and units of the shapes."""


class Bar(NamedTuple):
    """A filled rectangle: left, top, width, height."""

    x: int
    y: int
    w: int
    h: int
    colour: str


class Ring(NamedTuple):
    """A circle's line: centre, radius, width of the line."""

    x: int
    y: int
    r: int
    width: int
    colour: str


_DARK, _MASS, _SPRING = "#334155", "#0f766e", "#94a3b8"
SHAPES: Final[tuple[Bar | Ring, ...]] = (
    *(Bar(x, 61, 28, 6, _SPRING) for x in (12, 88)),
    *(Bar(61, y, 6, 28, _SPRING) for y in (12, 88)),
    *(Bar(x, 44, 6, 40, _DARK) for x in (6, 116)),
    *(Bar(44, y, 40, 6, _DARK) for y in (6, 116)),
    Bar(40, 40, 48, 48, _MASS),
    Ring(64, 64, 15, 4, "#ffffff"),
)


def svg() -> str:
    """The icon as SVG."""
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE}" viewBox="0 0 {SIZE} {SIZE}">']
    for shape in SHAPES:
        if isinstance(shape, Bar):
            x, y, w, h, colour = shape
            lines.append(f'  <rect x="{x}" y="{y}" width="{w}" height="{h}" fill="{colour}"/>')
        else:
            x, y, r, width, colour = shape
            stroke = f'fill="none" stroke="{colour}" stroke-width="{width}"'
            lines.append(f'  <circle cx="{x}" cy="{y}" r="{r}" {stroke}/>')
    return "\n".join([*lines, "</svg>"]) + "\n"


def png() -> bytes:
    """The icon as PNG, 8 bits each of red, green, blue and opacity (ISO/IEC 15948)."""
    pixels = np.zeros((SIZE, SIZE, 4), np.uint8)
    row, column = np.mgrid[0:SIZE, 0:SIZE] + 0.5
    for shape in SHAPES:
        if isinstance(shape, Bar):
            inside = (abs(column - shape.x - shape.w / 2) < shape.w / 2) & (
                abs(row - shape.y - shape.h / 2) < shape.h / 2
            )
        else:
            inside = abs(np.hypot(column - shape.x, row - shape.y) - shape.r) < shape.width / 2
        pixels[inside] = [*bytes.fromhex(shape.colour[1:]), 255]
    rows = b"".join(b"\0" + line.tobytes() for line in pixels)
    header = struct.pack(">2I5B", SIZE, SIZE, 8, 6, 0, 0, 0)
    # Level 0 stores: no version of zlib gives other bytes.
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows, 0)), (b"IEND", b""))
    packed = (struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)
