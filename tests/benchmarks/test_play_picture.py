"""The animated picture: what is written holds each frame."""

import struct
import zlib
from pathlib import Path

import numpy as np

from benchmarks.play_picture import COLOURS, HEIGHT, LARGEST, WIDTH, animated_png, with_palette

COMMITTED = Path(__file__).parents[2] / "docs" / "play.png"


def chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    found, at = [], 8
    while at < len(data):
        size, name = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + size]
        assert struct.unpack(">I", data[at + 8 + size : at + 12 + size])[0] == zlib.crc32(name + body)
        found.append((name, body))
        at += 12 + size
    return found


def test_frames_can_be_read_back() -> None:
    rng = np.random.default_rng(1)
    colours = (rng.integers(0, 31, (COLOURS, 3)) * 8).astype(np.uint8)
    frames = [colours[rng.integers(0, COLOURS, (HEIGHT, WIDTH))] for _ in range(3)]
    palette, indices = with_palette(frames)
    parts = chunks(animated_png(palette, indices, 80))
    shown = np.zeros((HEIGHT, WIDTH), int)
    images = [body if name == b"IDAT" else body[4:] for name, body in parts if name in (b"IDAT", b"fdAT")]
    assert len(images) == len(frames)
    for image, frame in zip(images, frames, strict=True):
        rows = np.frombuffer(zlib.decompress(image), np.uint8).reshape(HEIGHT, WIDTH + 1)
        assert not rows[:, 0].any()
        shown = np.where(rows[:, 1:] == COLOURS, shown, rows[:, 1:])
        assert np.array_equal(palette[shown], frame)
    numbers = [struct.unpack(">I", body[:4])[0] for name, body in parts if name in (b"fcTL", b"fdAT")]
    assert numbers == list(range(len(numbers)))


def test_the_committed_picture_moves_and_is_small() -> None:
    parts = dict(chunks(COMMITTED.read_bytes()))
    assert COMMITTED.stat().st_size <= LARGEST
    assert struct.unpack(">II", parts[b"acTL"])[0] > 20
