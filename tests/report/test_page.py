"""The report as a page: its numbers, and what a browser makes of it."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from html import unescape
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import forked
import meshio
import numpy as np
import pytest
from bent import curved, mesh_of, straight
from elements import MESHES
from numpy.typing import NDArray
from places import SAMPLES
from reports import FIRST, built, report_on, tangled

from meshfix_cli import read
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.repair.judge import Judge
from meshfix_cli.report import figures
from meshfix_cli.report.facts import Report
from meshfix_cli.report.figures import figures as figures_of
from meshfix_cli.report.page import page

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

    Open = Callable[..., AbstractContextManager[Page]]

TANGLED = {2: SAMPLES / "plate_tangled.vtk", 3: SAMPLES / "bracket_tangled.vtk"}
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
EVERY_TYPE = ("quads and triangles", "hex bracket", "every solid")
HOSTILE = '</title></script><script>window.bad=1</script><img src=x onerror="window.bad=1">'


def run(*arguments: object, code: int = 0) -> subprocess.CompletedProcess[bytes]:
    done = forked.run([*map(str, arguments)], b"")
    assert done.returncode == code, done.stderr.decode()
    return done


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """Pages of repaired samples, by their dimension, beside what --json says of the same run."""
    folder = tmp_path_factory.mktemp("pages")
    for dimension, sample in TANGLED.items():
        name, result = folder / f"{dimension}.html", folder / f"{dimension}.vtk"
        (folder / f"{dimension}.json").write_bytes(run("untangle", "--json", "--report", name, sample, result).stdout)
    return {dimension: folder / f"{dimension}.html" for dimension in TANGLED}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("there is no chromium")
    arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield opened
        opened.close()


@pytest.fixture
def visit(browser: Browser) -> Open:
    @contextmanager
    def opened(path: Path, script: str = "", **options: Any) -> Iterator[Page]:
        """A page whose picture is drawn; it must have loaded nothing else and complained of nothing."""
        context = browser.new_context(**{"viewport": {"width": 480, "height": 440}, **options})
        context.add_init_script(script)
        tab, loaded, complaints = context.new_page(), [], []
        tab.on("request", lambda request: loaded.append(request.url))
        tab.on("console", lambda message: complaints.append(message.text))
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.goto(path.as_uri())
        yield tab
        assert loaded == [path.as_uri()]
        assert complaints == []
        context.close()

    return opened


def settled(tab: Page) -> NDArray[np.int64]:
    """The picture (height, width, 3) once what was asked for is drawn."""
    tab.wait_for_selector("canvas[data-drawn]")
    tab.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    image = pytest.importorskip("matplotlib.image").imread(io.BytesIO(tab.locator("canvas").screenshot()))
    return (image[..., :3] * 255).round().astype(np.int64)


def amber(image: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The pixels that have the colour of the worst elements, in the light or in the shade."""
    red, green, blue = np.moveaxis(image, 2, 0)
    return (red > 120) & (green > 0.55 * red) & (green < 0.9 * red) & (blue < 0.65 * green)


def red(image: NDArray[np.int64]) -> NDArray[np.bool_]:
    """The pixels that have the colour of inverted elements."""
    return (image[..., 0] > 100) & (image[..., 1] < 0.68 * image[..., 0]) & ~amber(image)


def stage(tab: Page, name: str) -> NDArray[np.int64]:
    tab.get_by_label(name, exact=True).check()
    return settled(tab)


def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def embedded(path: Path, name: str) -> Any:
    found = re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', text(path), re.DOTALL)
    assert found
    return json.loads(found[1])


def rows(path: Path, caption: str) -> list[list[str]]:
    """The cells of a table."""
    (table,) = (part for part in re.findall(r"<table.*?</table>", text(path), re.DOTALL) if caption in part)
    lines = re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)
    return [[unescape(re.sub("<.*?>", "", cell)) for cell in re.findall(r"<t[hd].*?</t[hd]>", line)] for line in lines]


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_numbers_are_those_of_the_json_report(written: dict[int, Path], dimension: int) -> None:
    path = written[dimension]
    facts = json.loads(path.with_suffix(".json").read_text())
    assert embedded(path, "report") == facts
    table = {name: cells for name, *cells in rows(path, "Quality of each stage")}
    stages = facts["quality"]
    assert table[""] == list(stages)
    assert table["inverted elements"] == [f"{one['inverted']:,}" for one in stages.values()]
    angle = "smallest angle [°]" if dimension == 2 else "smallest dihedral angle [°]"
    assert table[angle] == [f"{one['min_angle']:.3f}" for one in stages.values()]
    bins = np.transpose([stages[name]["histogram"]["counts"] for name in ("before", "smoothed")])
    shown = rows(path, "Elements by their smallest angle")[1:]
    assert [[int(cell.replace(",", "")) for cell in cells] for _, *cells in shown] == bins.tolist()
    sweeps = [[one["phase"], f"{one['inverted']:,}", f"{one['min_measure']:.3g}"] for one in facts["sweeps"]]
    assert [line[1:4] for line in rows(path, "Every sweep")[1:]] == sweeps


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_worst_elements_are_named_as_the_file_does(written: dict[int, Path], dimension: int) -> None:
    document = read(written[dimension].with_suffix(".vtk"))
    angles = evaluate("min_angle", document.mesh)
    worst = np.argsort(angles, kind="stable")[:10]
    centroids = document.source.points[document.parts[0].vertices[worst]].mean(axis=1)
    listed = rows(written[dimension], "worst elements")[1:]
    assert [(line[0], line[2]) for line in listed] == [(str(document.ids[i]), f"{angles[i]:.3f}") for i in worst]
    for line, centroid in zip(listed, centroids, strict=True):
        np.testing.assert_allclose([float(x) for x in line[5].strip("()").split(",")], centroid, rtol=1e-5, atol=1e-8)


@pytest.fixture(scope="module")
def of_every_type(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages of tangled meshes that are not of simplices alone, and of the same as they should be."""
    folder = tmp_path_factory.mktemp("of_every_type")
    for name in EVERY_TYPE:
        report = report_on(tangled(name), built(name), command="untangle")
        (folder / f"{name}.html").write_text(page(report, figures_of(report), {}), encoding="utf-8")
    return {name: folder / f"{name}.html" for name in EVERY_TYPE}


@pytest.mark.parametrize("name", EVERY_TYPE)
def test_tables_of_elements_of_every_type(of_every_type: dict[str, Path], name: str) -> None:
    path, mesh = of_every_type[name], built(name)
    values = evaluate("scaled_jacobian", mesh)
    stages = embedded(path, "report")["quality"]
    table = {label: cells for label, *cells in rows(path, "Quality of each stage")}
    smallest = [f"{stages[stage]['scaled_jacobian']['smallest']:.3f}" for stage in ("before", "smoothed")]
    assert table["smallest scaled Jacobian"] == smallest
    head, *counts = rows(path, "Elements by their scaled Jacobian")
    assert head == ["scaled Jacobian", "before", "smoothed"]
    assert [counts[0][0], counts[-1][0], len(counts)] == ["0–0.05", "0.95–1", 20]
    expected, _ = np.histogram(values, np.linspace(0, 1, 21))
    assert sum(int(cells[2].replace(",", "")) for cells in counts) == expected.sum() == mesh.topology.m
    listed = rows(path, "worst elements")[1:]
    words = {block.element.shape.name: block.rows for block in mesh.topology.blocks}
    for line, value in zip(listed, np.sort(values), strict=False):
        word, number = line[0].split()
        assert int(number) - FIRST in words[word]
        assert line[2] == f"{value:.3f}" == f"{values[int(number) - FIRST]:.3f}"
    if len(words) > 1:
        assert rows(path, "by types of elements")[0][1:] == [one.element.shape.plural for one in mesh.topology.blocks]


@pytest.mark.parametrize("name", EVERY_TYPE)
def test_what_is_drawn_of_elements_of_every_type(of_every_type: dict[str, Path], name: str) -> None:
    """Each layer has whole elements of its type, whose vertices are there; the boundary has its facets."""
    scene, (points, cells) = embedded(of_every_type[name], "scene"), MESHES[name]()
    nodes = {"line": 2, "triangle": 3, "quad": 4, **{key: block.shape[1] for key, block in cells}}
    drawn: dict[str, set[str]] = {}
    for layer in scene["layers"]:
        packed = scene["rows"][layer["rows"]]
        numbers = np.frombuffer(base64.b64decode(packed["data"]), "<u4" if packed["wide"] else "<u2")
        coordinates = np.frombuffer(base64.b64decode(scene["points"][layer["points"]]), "<f4")
        assert scene["shapes"][layer["shape"]]["corners"] == nodes[layer["shape"]]
        assert len(numbers) % nodes[layer["shape"]] == 0
        assert numbers.max() < len(coordinates) / points.shape[1]
        drawn.setdefault(layer["role"], set()).add(layer["shape"])
    assert drawn["inverted"] == {key for key, _ in cells}
    assert drawn["boundary"] <= ({"line"} if points.shape[1] == 2 else {"triangle", "quad"})
    assert drawn.get("cells", drawn["inverted"]) == {key for key, _ in cells}


@pytest.mark.parametrize("name", EVERY_TYPE)
def test_a_browser_draws_elements_of_every_type(visit: Open, of_every_type: dict[str, Path], name: str) -> None:
    with visit(of_every_type[name]) as tab:
        before, after = settled(tab), stage(tab, "smoothed")
        tab.get_by_role("button", name="Show").first.click()
        closer = settled(tab)
        number = rows(of_every_type[name], "worst elements")[1][0]
        assert tab.locator("#drawn").inner_text() == f"smoothed: 0 inverted elements; in the middle {number}"
    assert red(before).sum() > 4_000 > 50 > red(after).sum()
    assert amber(closer).sum() > amber(after).sum() > 50


@pytest.mark.parametrize("key", ["triangle6", "quad8", "tetra10", "hexahedron27"])
def test_a_browser_draws_curved_elements(visit: Open, tmp_path: Path, key: str) -> None:
    """Their edges in pieces; where nothing is curved the page has no lines but those of the sides."""
    quadratic, points, free = curved(key, 0.8)
    mesh = mesh_of(quadratic, points, key, straight(key)[1], free)
    flat = mesh.with_points(quadratic.straight(points))
    for name, meshes in (("curved", (mesh, flat)), ("flat", (flat, flat))):
        report = report_on(*meshes, command="untangle")
        (tmp_path / f"{name}.html").write_text(page(report, figures_of(report), {}), encoding="utf-8")
    scenes = {name: embedded(tmp_path / f"{name}.html", "scene") for name in ("curved", "flat")}
    pieces = {layer["shape"] for layer in scenes["curved"]["layers"] if layer["role"] == "inverted"}
    assert all(len(scenes["curved"]["shapes"][one]["edges"]) >= 4 * ELEMENTS[key].shape.corners for one in pieces)
    assert not any("edges" in shape for shape in scenes["flat"]["shapes"].values())
    with visit(tmp_path / "curved.html") as tab:
        before, after = settled(tab), stage(tab, "smoothed")
    assert red(before).sum() > 1_000 > 50 > red(after).sum()


def test_options_and_versions_are_there(tmp_path: Path) -> None:
    name = tmp_path / "p.html"
    run("quality", "-q", "--report", name, "--require", "min_angle > 1", "--threads", 1, TANGLED[2], code=3)
    made = {line[0]: line[1] for line in rows(name, "Options and versions")}
    assert made["--require"] == "min_angle > 1"
    assert {"meshfix-cli", "numpy", "scipy", "meshio", "Python", "--report"} <= set(made)
    assert "NOT MET: min_angle" in text(name)
    run("untangle", "-q", "--report", name, "--smooth", 0, "--max-move", "2h", TANGLED[2], tmp_path / "o.vtk")
    made = {line[0]: line[1] for line in rows(name, "Options and versions")}
    assert (made["--smooth"], made["--max-move"], made["--strategy"]) == ("0", "2h", "auto (default)")


def test_elements_numbered_against_the_rest_are_inverted(tmp_path: Path) -> None:
    """As `--cells` has it: for whoever reads the file they are."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]]
    cells = [[0, 1, 4], [1, 2, 4], [2, 4, 3], [3, 0, 4]]
    meshio.write_points_cells(tmp_path / "m.vtk", np.array(points), [("triangle", np.array(cells))])
    run("quality", "-q", "--report", tmp_path / "p.html", tmp_path / "m.vtk", code=3)
    listed = {line[0]: line[4] for line in rows(tmp_path / "p.html", "worst elements")[1:]}
    assert listed == {"0": "no", "1": "no", "2": "yes", "3": "no"}


def test_names_that_cannot_be_written_to(tmp_path: Path) -> None:
    mesh, link = TANGLED[2], tmp_path / "mesh.html"
    link.symlink_to(mesh)
    assert b"is the name of a mesh" in run("quality", "--report", link, mesh, code=2).stderr
    link.unlink()
    assert b"name a file" in run("quality", "--report", "-", mesh, code=2).stderr
    assert b"take one INPUT" in run("quality", "--report", tmp_path / "p.html", mesh, mesh, code=2).stderr
    twice = ["--report", tmp_path / "p", "--history", tmp_path / "p"]
    assert b"of another file to be written" in run("untangle", *twice, mesh, tmp_path / "o.vtk", code=2).stderr
    assert (
        b"may be the name of the backup"
        in run("untangle", "--backup", "--report", tmp_path / "o.bak.html", mesh, tmp_path / "o", code=2).stderr
    )
    missing = ["--report", tmp_path / "no" / "p.html"]
    assert b"does not exist" in run("untangle", *missing, mesh, tmp_path / "o.vtk", code=1).stderr
    assert list(tmp_path.iterdir()) == []


def report_of(sample: Path, **changes: Any) -> Report:
    document = read(sample)
    return replace(Judge().report("quality", document, {"mesh": document.mesh}), **changes)


@pytest.mark.parametrize(("dimension", "least"), [(2, 4_000), (3, 1_500)])
def test_inverted_elements_are_red_before_and_none_are_left(
    visit: Open, written: dict[int, Path], dimension: int, least: int
) -> None:
    with visit(written[dimension]) as tab:
        assert tab.locator("#drawn").inner_text().startswith("before: ")
        before, after = settled(tab), stage(tab, "smoothed")
        assert tab.locator("#drawn").inner_text() == "smoothed: 0 inverted elements"
    assert red(before).sum() > least > 50 > red(after).sum()
    assert amber(after).sum() > 100


@pytest.mark.parametrize("dimension", [2, 3])
def test_pointer_wheel_and_keys_move_the_picture(visit: Open, written: dict[int, Path], dimension: int) -> None:
    with visit(written[dimension]) as tab:
        seen = [settled(tab)]
        canvas = tab.locator("canvas")
        box = canvas.bounding_box()
        assert box
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        tab.mouse.move(*middle)
        tab.mouse.down()
        tab.mouse.move(middle[0] + 120, middle[1] + 40)
        tab.mouse.up()
        seen.append(settled(tab))
        tab.mouse.wheel(0, -200)
        seen.append(settled(tab))
        canvas.focus()
        for key in ("ArrowLeft", "+", "-"):
            tab.keyboard.press(key)
            seen.append(settled(tab))
        assert all((np.abs(a - b).sum(axis=2) > 30).sum() > 500 for a, b in pairwise(seen))
        assert (seen[3] == seen[5]).mean() > 0.99  # + and - undo each other
        for key in ("0", "ArrowUp", "Home"):
            tab.keyboard.press(key)
        tab.mouse.move(0, 0)
        assert (settled(tab) == seen[0]).mean() > 0.99


def test_a_pinch_zooms_and_one_finger_turns(visit: Open, written: dict[int, Path]) -> None:
    with visit(written[3], has_touch=True) as tab:
        first = settled(tab)
        box = tab.locator("canvas").bounding_box()
        assert box
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        touch = tab.context.new_cdp_session(tab)

        def fingers(kind: str, *places: float) -> None:
            points = [{"x": x + place, "y": y, "id": i} for i, place in enumerate(places)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        for places in [(-50, 50), (-100, 100)], [(0,), (80,)]:
            fingers("touchStart", *places[0])
            fingers("touchMove", *places[1])
            fingers("touchEnd")
            second = settled(tab)
            assert (np.abs(first - second).sum(axis=2) > 30).sum() > 500
            if len(places[0]) == 2:
                assert (second < 200).any(axis=2).sum() > 1.5 * (first < 200).any(axis=2).sum()
            first = second


def test_an_element_of_the_table_is_shown(visit: Open, written: dict[int, Path]) -> None:
    with visit(written[3]) as tab:
        before = amber(stage(tab, "smoothed")).sum()
        tab.get_by_role("button", name="Show element").first.click()
        closer = amber(settled(tab)).sum()
        name = rows(written[3], "worst elements")[1][0]
        assert tab.locator("#drawn").inner_text() == f"smoothed: 0 inverted elements; in the middle element {name}"
        assert tab.evaluate("document.activeElement.id") == "canvas"
        assert not tab.locator("#no-picture").is_visible()
    assert closer > 2 * before


@pytest.mark.parametrize("dimension", [2, 3])
def test_axe_finds_nothing_and_a_phone_does_not_scroll_sideways(
    visit: Open, written: dict[int, Path], dimension: int
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    with visit(written[dimension], viewport={"width": 360, "height": 640}) as tab:
        tab.evaluate("for (const one of document.querySelectorAll('details')) one.open = true")
        pictures = []
        for scheme in ("light", "dark"):
            tab.emulate_media(color_scheme=scheme)
            pictures.append(settled(tab))
            assert tab.evaluate("document.documentElement.scrollWidth") == 360
            found = axe.Axe().run(tab)
            assert found.violations_count == 0, found.generate_report()
    assert pictures[0].mean() > 180 > 80 > pictures[1].mean()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("width", [320, 360, 600])
def test_the_worst_elements_are_not_cut_on_a_phone(
    visit: Open, written: dict[int, Path], dimension: int, width: int
) -> None:
    """Nothing of the table is beyond the edge of the screen, the names of its columns stand before each value."""
    with visit(written[dimension], viewport={"width": width, "height": 640}) as tab:
        settled(tab)
        region = tab.get_by_role("region", name="The 10 worst elements")
        assert region.evaluate("one => one.scrollWidth <= one.clientWidth")
        first = rows(written[dimension], "worst elements")[1]
        box = region.get_by_text(first[5]).first.bounding_box()
        assert box
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width
        named = region.locator("td[data-column]").first.evaluate("one => getComputedStyle(one, '::before').content")
        assert "smallest" in named
        region.get_by_role("button", name="Show element").first.click()
        assert f"in the middle element {first[0]}" in tab.locator("#drawn").inner_text()


def test_what_users_write_is_shown_and_not_run(visit: Open, tmp_path: Path) -> None:
    report = report_of(TANGLED[2], name=HOSTILE, notes=[HOSTILE], fixed={HOSTILE: 1})
    path = tmp_path / "<img src=x onerror=alert(1)>&amp;.html"
    path.write_text(page(report, figures_of(report), {"--fix": HOSTILE}), encoding="utf-8")
    with visit(path) as tab:
        settled(tab)
        assert tab.evaluate("window.bad") is None
        assert HOSTILE in tab.locator("header").inner_text()
        assert tab.locator("img").count() == 0
        assert tab.locator("script").count() == 3


def test_meshes_that_are_too_large_are_drawn_in_part(
    visit: Open, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "MOST_INVERTED", 50)
    monkeypatch.setattr(figures, "MOST_FACETS", 900)
    monkeypatch.setattr(figures, "MOST_CELLS", 100)
    for dimension, words in ((2, "mesh: 89 inverted"), (3, "mesh: 700 inverted")):
        report, path = report_of(TANGLED[dimension]), tmp_path / f"{dimension}.html"
        path.write_text(page(report, figures_of(report), {}), encoding="utf-8")
        with visit(path) as tab:
            assert red(settled(tab)).sum() > 500
            assert tab.locator("#drawn").inner_text() == f"{words} elements, of which 50 are drawn"
            assert ("boundary, drawn coarsely" in tab.locator(".legend").inner_text()) == (dimension == 3)


def test_without_webgl_a_sentence_says_so(visit: Open, written: dict[int, Path]) -> None:
    with visit(written[2], script="HTMLCanvasElement.prototype.getContext = () => null") as tab:
        assert tab.get_by_text("The picture needs JavaScript and WebGL 2").is_visible()
        assert not tab.locator("canvas").is_visible()
        assert tab.get_by_role("button", name="Show element").count() == 0
        assert tab.get_by_role("table").first.is_visible()


def test_without_scripts_the_tables_are_there(visit: Open, written: dict[int, Path]) -> None:
    with visit(written[2], java_script_enabled=False) as tab:
        assert tab.get_by_text("The picture needs JavaScript and WebGL 2").is_visible()
        assert tab.get_by_role("button").count() == 0
        assert tab.get_by_role("img").count() == 3
        assert tab.get_by_role("table").count() == 3


def test_nothing_but_plain_graphics_is_in_the_file(written: dict[int, Path]) -> None:
    for path in written.values():
        content = text(path)
        assert len(content) < 150_000
        assert not re.findall(r"(?:https?:)?//[a-z]", re.sub(r"<script type.*?</script>", "", content, flags=re.DOTALL))
        assert "default-src 'none'" in content


def test_facets_off_their_shape_are_drawn_where_the_boundary_slides(tmp_path: Path, visit: Open) -> None:
    name, colours = tmp_path / "page.html", ("near", "off", "beyond")
    options = "--slide", "curved", "--smooth", "best", "--dry-run", "--json", "--report", name
    facts = json.loads(run("untangle", *options, TANGLED[3]).stdout)["shape"]
    assert 0.5 * facts["bound"] < facts["deviation"] <= facts["bound"] * (1 + 1e-9)
    assert facts["beyond"] == 0
    last = [layer["role"] for layer in embedded(name, "scene")["layers"] if layer["stage"] == 2]
    assert [role for role in colours if role in last] == ["near", "off"]
    assert all(f'<i class="{role}">' in name.read_text() for role in colours)
    with visit(name) as tab:
        before, after = settled(tab), stage(tab, "smoothed")
    blue = [(image[..., 2] > image[..., 0] + 40).sum() for image in (before, after)]
    assert blue[1] > blue[0] + 1000
