"""Everything that the README and the pages in docs/ show is run, and prints what they say it prints."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import make_gallery
import pytest
import used
from places import ROOT

from meshfix_cli import quality
from meshfix_cli.cli import main

README = (ROOT / "README.md").read_text()
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
each_page = pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
TEXT = "\n".join(page.read_text() for page in PAGES)

SECONDS = re.compile(r"\d[\d.,e-]* (s\b|files a second)")


def blocks(language: str, text: str = TEXT) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands(text: str) -> list[tuple[str, str]]:
    """Commands and the output shown below each."""
    shown = []
    for block in blocks("console", text):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = part.partition("\n")
            if not command.startswith("make"):
                shown.append((command, output))
    return shown


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "sample_meshes").symlink_to(ROOT / "sample_meshes")
    return tmp_path


def with_files(page: Path, folder: Path) -> Path:
    """Put the files there that a page is about."""
    if page.parent.name == "use" and page.stem in used.FILES:
        used.FILES[page.stem](folder)
    return folder


def run(command: list[str], folder: Path) -> str:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(command, capture_output=True, check=False, cwd=folder, env=environment)
    assert done.returncode in (0, 3), done.stderr.decode()
    return done.stdout.decode()


@each_page
def test_commands_print_what_is_shown(page: Path, folder: Path) -> None:
    shown = commands(page.read_text())
    if shown:
        with_files(page, folder)
    for command, output in shown:
        printed = run(["bash", "-o", "pipefail", "-c", command], folder)
        assert SECONDS.sub("", printed) == SECONDS.sub("", output), command


@each_page
def test_python_examples_print_what_is_shown(page: Path, folder: Path) -> None:
    """Each in the folder where those before have written; what is printed follows as a block of text."""
    examples, outputs = (blocks(language, page.read_text()) for language in ("python", "text"))
    assert len(examples) == len(outputs)
    if examples:
        with_files(page, folder)
    for example, output in zip(examples, outputs, strict=True):
        assert run([sys.executable, "-c", example], folder) == output, example


def test_options_of_commands_for_clusters_exist() -> None:
    commands = re.findall(r"meshfix (\w+) ([^\n]*)", "".join(blocks("sh")))
    assert {name for name, _ in commands} == {"batch", "untangle"}
    for name, arguments in commands:
        known = {option for parameter in main.commands[name].params for option in parameter.opts}
        assert set(re.findall(r"--[a-z-]+", arguments.partition(":::")[0])) <= known


@each_page
def test_options_that_pages_name_exist(page: Path) -> None:
    """In their tables, of one command or another."""
    known = {option for one in main.commands.values() for parameter in one.params for option in parameter.opts}
    rows = re.findall(r"^\| (`--.*?) \|", page.read_text(), re.MULTILINE)
    assert set(re.findall(r"`(--[a-z-]+)", "".join(rows))) <= known
    assert rows or page.parent.name != "use"


def test_pages_are_in_the_list_of_the_site() -> None:
    told = set(re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text()))
    assert told == {page.relative_to(ROOT / "docs").as_posix() for page in PAGES[1:]}


def test_make_targets_exist() -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"make ([a-z]+)", TEXT)) <= targets


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
            assert target.startswith("https://") or (page.parent / target).exists(), (page.name, target)


def test_pictures_are_made_by_make_figures() -> None:
    pictures = set(re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README))
    assert pictures
    made = (ROOT / "Makefile").read_text().partition("\nfigures:")[2].partition("\n\n")[0]
    assert all(picture in made for picture in pictures)


def test_the_gallery_is_what_is_drawn() -> None:
    """Its pictures are those that its script makes, small, and what is told of them is so."""
    names = re.findall(r"\]\(gallery/(\w+)\.png\)", (ROOT / "docs/gallery.md").read_text())
    assert sorted(names) == sorted([*make_gallery.RENDERED, make_gallery.PLOTTED])
    assert sorted(path.stem for path in make_gallery.GALLERY.iterdir()) == sorted(names)
    assert sum(path.stat().st_size for path in make_gallery.GALLERY.iterdir()) < 300_000
    told = re.findall(r"(\d+) inverted", (ROOT / "docs/gallery.md").read_text())
    assert len(told) == len(names)
    for name, sample in make_gallery.RENDERED.items():
        assert str(quality(ROOT / "sample_meshes" / sample).inverted) in told, name


def test_the_picture_of_the_plate_is_what_the_tool_draws(folder: Path) -> None:
    """But for the release of matplotlib, which is named in it and may place things otherwise."""
    pytest.importorskip("matplotlib", reason="without matplotlib nothing is plotted: pip install 'meshfix-cli[plot]'")
    command = ["untangle", "--quiet", "--dry-run", "--plot", "plate.svg", "sample_meshes/plate_tangled.vtk"]
    run([sys.executable, "-m", "meshfix_cli", *command], folder)
    drawn, kept = (folder / "plate.svg").read_text(), (ROOT / "docs/pictures/plate.svg").read_text()
    creator = re.compile("<dc:title>Matplotlib v[^<]*")
    if creator.findall(drawn) == creator.findall(kept):
        assert drawn == kept
    assert "before: 89 inverted" in drawn
