"""The animated picture of the page of `gyrotwin play`, for README and site: `make picture`.

    python -m benchmarks.play_picture [FILE]

The page runs in headless Chromium, is stepped by hand and drawn by its own functions; what its canvases hold becomes an
animated PNG (APNG, PNG third edition, 2025, section 11.3.3) with a palette: docs/play.png, at most 500 kB.
"""

import base64
import struct
import sys
import tempfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

import gyrotwin as gt
from benchmarks.tab import Tab, url_of

Picture = NDArray[np.uint8]

WIDTH: Final = 720
HEIGHT: Final = 340
FRAMES: Final = 40
HALF_TURN: Final = np.pi / 5.0
"""s: at 5 rad/s the orbit has turned by 180°, and is the one it began as."""
HOLD: Final = 80
"""ms a frame."""
COLOURS: Final = 64
LARGEST: Final = 500_000
"""Bytes."""
SETUP: Final = f"""
scene.running = false, document.getElementById("ghost").checked = false, scene.pluck();
var sheet = new OffscreenCanvas({WIDTH}, {HEIGHT}).getContext("2d", {{willReadFrequently: true}});
"""
# The orbit to the left, two plots to the right; drawn anew at the sizes they have here.
FRAME: Final = """
(() => {
  scene.advance(%(samples)d);
  player.reach = 1.15 * scene.first || 1.15;
  player.draw(), player.drawPlots();
  const put = (id, x, y, w, h) => sheet.drawImage(document.getElementById(id), x, y, w, h);
  sheet.fillStyle = css("--paper"), sheet.fillRect(0, 0, %(width)d, %(height)d);
  put("orbit", 8, 8, 324, 324), put("spectrum", 342, 40, 370, 125), put("angle", 342, 205, 370, 125);
  sheet.fillStyle = css("--ink"), sheet.font = "600 13px system-ui, sans-serif";
  sheet.fillText("Spectrum of both voltages [V]", 348, 28), sheet.fillText("The orbit has turned by [°]", 348, 193);
  const {data} = sheet.getImageData(0, 0, %(width)d, %(height)d);
  let text = "";
  for (let k = 0; k < data.length; k += 32768) text += String.fromCharCode(...data.subarray(k, k + 32768));
  return btoa(text);
})()
"""


def frames_of(page: Path) -> list[Picture]:
    """The frames, each (HEIGHT, WIDTH, 3)."""
    pictures = []
    with Tab(url_of(page), dark=True) as tab:
        tab.wait("document.documentElement.dataset.drawn && player && player.frames > 5")
        # Plots at the sizes of the picture, so that their letters keep theirs.
        for name, width, height in (("orbit", 324, 324), ("spectrum", 370, 125), ("angle", 370, 125)):
            tab.run(f"document.getElementById('{name}').style.cssText = 'width: {width}px; height: {height}px'")
        tab.run(SETUP)
        step = tab.run("data.step")
        script = FRAME % {"samples": round(HALF_TURN / step / FRAMES), "width": WIDTH, "height": HEIGHT}
        for _ in range(FRAMES):
            raw = np.frombuffer(base64.b64decode(tab.run(script)), np.uint8)
            pictures.append(raw.reshape(HEIGHT, WIDTH, 4)[..., :3])
    return pictures


def with_palette(pictures: Sequence[Picture]) -> tuple[Picture, list[Picture]]:
    """A palette (COLOURS, 3) and the pictures as indices of it: the most frequent colours, each other one as the
    nearest of them."""
    flat = np.concatenate([p.reshape(-1, 3) for p in pictures]) & 0xF8
    colours, places, counts = np.unique(flat, axis=0, return_inverse=True, return_counts=True)
    # Frequent ones and, by the root, those of thin lines.
    palette = _spread(colours, np.sqrt(counts))
    apart = ((colours[:, None, :].astype(int) - palette[None].astype(int)) ** 2).sum(axis=2)
    indices = apart.argmin(axis=1).astype(np.uint8)[places.ravel()]
    return palette, list(indices.reshape(len(pictures), HEIGHT, WIDTH))


def _spread(colours: Picture, weights: NDArray[np.float64]) -> Picture:
    """COLOURS of ``colours``, each next one where weight times distance to those chosen is largest."""
    chosen = [int(weights.argmax())]
    distance = np.full(len(colours), np.inf)
    for _ in range(COLOURS - 1):
        apart = ((colours.astype(float) - colours[chosen[-1]]) ** 2).sum(axis=1)
        distance = np.minimum(distance, apart)
        chosen.append(int((distance * weights).argmax()))
    return colours[chosen]


def animated_png(palette: Picture, pictures: Sequence[Picture], hold: int) -> bytes:
    """An endless APNG of indexed ``pictures``, each shown ``hold`` ms; pixels that stay are not said again."""
    height, width = pictures[0].shape
    transparent = len(palette)
    header = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    parts = [
        _chunk(b"IHDR", header),
        _chunk(b"acTL", struct.pack(">II", len(pictures), 0)),
        _chunk(b"PLTE", palette.tobytes() + b"\0\0\0"),
        _chunk(b"tRNS", b"\xff" * transparent + b"\0"),
    ]
    number = 0
    for k, picture in enumerate(pictures):
        changed = picture if k == 0 else np.where(picture == pictures[k - 1], transparent, picture).astype(np.uint8)
        rows = np.insert(changed, 0, 0, axis=1)  # each row without a filter
        data = zlib.compress(rows.tobytes(), 9)
        # Kept when the next one comes, drawn over what is there.
        control = struct.pack(">IIIIIHHBB", number, width, height, 0, 0, hold, 1000, 0, 1)
        parts.append(_chunk(b"fcTL", control))
        parts.append(_chunk(b"IDAT", data) if k == 0 else _chunk(b"fdAT", struct.pack(">I", number + 1) + data))
        number += 1 if k == 0 else 2
    return b"\x89PNG\r\n\x1a\n" + b"".join([*parts, _chunk(b"IEND", b"")])


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def main(out: Path) -> None:
    """Writes the picture. Raises InputError where it is larger than allowed."""
    with tempfile.TemporaryDirectory() as folder:
        pictures = frames_of(gt.play().save(folder) / "play.html")
    data = animated_png(*with_palette(pictures), HOLD)
    if len(data) > LARGEST:
        raise gt.InputError(f"picture of {len(data)} bytes: more than {LARGEST}; take fewer frames or colours")
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_bytes(data)
    print(f"{out}: {len(data) / 1e3:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/play.png"))
