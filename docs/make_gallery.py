"""Makes the pictures of docs/gallery.md, with what users have: `make figures`, or `python docs/make_gallery.py`."""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from meshfix_cli import untangle

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs" / "gallery"
COLOURS, WIDTH = 96, 1000  # of a picture, so that it is small
RENDERED = {
    "hexes": "hexes_tangled.inp",
    "mixed": "mixed_tangled.msh",
    "shell": "shell_tangled.obj",
    "quads": "quads_tangled.vtk",
}  # by `Result.plot`, from the samples
PLOTTED = "curved"  # by `--plot`, from the file of docs/use/second-order.md


def main() -> None:
    """Write every picture."""
    GALLERY.mkdir(exist_ok=True)
    for name, sample in RENDERED.items():
        picture = io.BytesIO()
        untangle(ROOT / "sample_meshes" / sample).plot(off_screen=True).screenshot(picture)
        save(name, picture)
    with tempfile.TemporaryDirectory() as folder:
        sys.path[:0] = [str(ROOT / one) for one in ("tests/support", "tests/meshfile", "sample_meshes", "benchmarks")]
        from used import FILES

        FILES["second-order"](Path(folder))
        command = ["untangle", "--quiet", "--dry-run", "--plot", f"{folder}/it.png", f"{folder}/ring.msh"]
        subprocess.run([sys.executable, "-m", "meshfix_cli", *command], check=True)
        save(PLOTTED, io.BytesIO((Path(folder) / "it.png").read_bytes()))


def save(name: str, picture: io.BytesIO) -> None:
    """Write a picture with few colours."""
    image = Image.open(picture).convert("RGB")
    image.thumbnail((WIDTH, WIDTH))
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(GALLERY / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()
