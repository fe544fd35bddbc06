"""The arrows of the design: which room may import which, and what must stay light."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from places import ROOT

import meshfix_cli

PACKAGE = ROOT / "meshfix_cli"
KERNELS = PACKAGE / "kernels"

# The rooms from the top floor down, and what each may import. Arrows run down only.
ROOMS: dict[str, set[str]] = {
    "__main__": {"cli"},
    "cli": {"errors", "kernels", "mesh", "meshfile", "quality", "repair", "report", "solve", "workers"},
    "workers": {"errors", "kernels", "mesh", "meshfile", "quality", "repair", "report", "solve"},
    "objects": {"errors", "mesh", "meshfile", "quality", "repair", "report", "solve"},
    "repair": {"errors", "mesh", "meshfile", "quality", "report", "solve"},
    "report": {"errors", "mesh", "quality", "solve"},
    "solve": {"kernels", "mesh", "quality"},
    "quality": {"kernels", "mesh"},
    "meshfile": {"errors", "kernels", "mesh"},
    "mesh": {"errors", "kernels"},
    "kernels": set(),
    "errors": set(),
}
KERNEL_ROOMS: dict[str, set[str]] = {
    "quadratic": {"moves", "measures", "mesh", "common"},
    "surface": {"moves", "measures", "mesh", "common"},
    "moves": {"measures", "mesh", "common"},
    "measures": {"mesh", "common"},
    "mesh": {"common"},
    "text": {"common"},
    "common": set(),
}
OWNERS = {
    "rich": {"report/terminal", "report/live"},
    "meshio": {"meshfile/formats", "meshfile/through_meshio"},
    "click": {"cli"},
    "distributed": {"workers/dask"},
    "mpi4py": {"cli", "workers/distributed", "workers/mpi"},
    "pymetis": {"workers/distributed"},
    "matplotlib": {"report/plot"},
    "pyvista": {"report/render"},
}
HEAVY = {"numpy", "scipy", "meshio", "rich", "matplotlib", "pyvista", "meshfix_cli.kernels"}
LINES = 500
CODE = (".py", ".pyi", ".cpp", ".hpp", ".js", ".css", ".html", ".txt", ".toml", ".md", "")


def module_of(path: Path) -> str:
    """The full name of a file's module."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


MODULES = {module_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def imports(path: Path) -> set[str]:
    """Full names of the modules a file imports, wherever the statement stands."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            homes = {f"meshfix_cli.{name}": f"meshfix_cli.{home}" for name, home in meshfix_cli._HOME.items()}
            found |= {name if name in MODULES else homes.get(name, node.module or "") for name in names}
    return found


def room_of(module: str) -> str:
    return module.split(".")[1]


def test_arrows_run_down() -> None:
    floors = list(ROOMS)
    assert {room_of(module) for module in MODULES if module != "meshfix_cli"} == set(floors)
    for room, below in ROOMS.items():
        assert below <= set(floors[floors.index(room) + 1 :]), room
    used: dict[str, set[str]] = {room: set() for room in floors}
    for module, path in MODULES.items():
        own = {name for name in imports(path) if name.startswith("meshfix_cli.") and name in MODULES}
        if module != "meshfix_cli":  # which gives names of all rooms to whoever asks
            used[room_of(module)] |= {room_of(name) for name in own} - {room_of(module)}
    assert used == ROOMS


def test_no_circle_of_imports() -> None:
    """Not even one of names that only type checkers follow; graphlib raises an error that names the circle."""
    arrows = {module: imports(path) & set(MODULES) - {"meshfix_cli"} for module, path in MODULES.items()}
    assert len(list(TopologicalSorter(arrows).static_order())) == len(MODULES)


def test_arrows_of_kernels_run_down() -> None:
    assert {path.name for path in KERNELS.iterdir() if path.is_dir()} - {"__pycache__"} == set(KERNEL_ROOMS)
    arrows = {}
    for path in (*KERNELS.rglob("*.hpp"), *KERNELS.glob("*/*.cpp")):
        names = set(re.findall(r'#include "([^"]+)"', path.read_text()))
        arrows[path.relative_to(KERNELS).as_posix()] = names
        room = path.parent.name
        allowed = KERNEL_ROOMS.get(room, set()) | {room}
        assert all((KERNELS / name).exists() for name in names)
        assert {name.split("/")[0] for name in names if "/" in name} <= allowed, path
    assert list(TopologicalSorter(arrows).static_order())


def test_no_file_is_long() -> None:
    folders = [ROOT, *(ROOT / name for name in ("meshfix_cli", "tests", "benchmarks", "docs", ".ci"))]
    files = {path for folder in folders for path in (folder.iterdir() if folder == ROOT else folder.rglob("*"))}
    checked = [path for path in files if path.is_file() and path.suffix in CODE and "__pycache__" not in path.parts]
    assert len(checked) > 100
    for path in checked:
        assert len(path.read_text().splitlines()) <= LINES, path


def test_each_heavy_package_has_one_importer() -> None:
    for package, owners in OWNERS.items():
        found = set()
        for module, path in MODULES.items():
            if package in {name.split(".")[0] for name in imports(path)}:
                found.add("/".join(module.split(".")[1:2] if room_of(module) == "cli" else module.split(".")[1:]))
        assert found == owners, package


def test_nothing_below_the_command_line_prints_exits_or_reads_the_environment() -> None:
    for module, path in MODULES.items():
        if module != "meshfix_cli" and room_of(module) in ("cli", "__main__"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in ("print", "exit", "quit"), path
            if isinstance(node, ast.Attribute):
                assert node.attr not in ("environ", "getenv", "exit"), path


def loaded(code: str) -> set[str]:
    """The modules that some code, which must succeed, has loaded at its end."""
    code = f"import sys\ntry:\n    {code}\nfinally:\n    print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    return set(done.stderr.split())


@pytest.mark.parametrize("statement", ["import meshfix_cli", "import meshfix_cli.cli"])
def test_imports_are_light(statement: str) -> None:
    assert "meshfix_cli" in loaded(statement)
    assert not HEAVY & loaded(statement)


@pytest.mark.parametrize("command", [[], ["untangle"], ["perturb"], ["quality"], ["batch"]])
def test_help_is_light(command: list[str]) -> None:
    modules = loaded(f"from meshfix_cli.cli import main; main([*{command}, '--help'])")
    assert {f"meshfix_cli.cli.{name}" for name in command or ["untangle", "batch"]} <= modules
    assert not HEAVY & modules


def test_what_few_need_is_not_loaded_to_untangle(tmp_path: Path) -> None:
    sample = ROOT / "sample_meshes" / "plate_tangled.vtk"
    arguments = ["untangle", "-q", str(sample), str(tmp_path / "o.vtk")]
    modules = loaded(f"from meshfix_cli.cli import main; main({arguments})")
    assert (tmp_path / "o.vtk").exists()
    assert not {"scipy", "matplotlib", "meshio", "meshfix_cli.report.figures", "numpy.ma"} & modules


def test_public_names_work_in_any_order_of_import() -> None:
    code = (
        "import meshfix_cli.solve.untangle, meshfix_cli.cli; from meshfix_cli import *\n"
        "print(callable(untangle), read, Mesh)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout.startswith("True <function read")


def test_every_module_and_public_function_has_a_docstring() -> None:
    for path in MODULES.values():
        tree = ast.parse(path.read_text())
        assert ast.get_docstring(tree), path
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and any(ast.unparse(one) == "overload" for one in node.decorator_list):
                continue  # it is told where they are brought together
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{path.name}: {node.name}"


def test_tests_mirror_the_rooms() -> None:
    rooms = {path.name for path in (ROOT / "tests").iterdir() if path.is_dir()} - {"__pycache__"}
    assert rooms == {*ROOMS, "project", "support"} - {"__main__", "errors", "repair"}


def test_version_and_dependencies_are_those_of_the_project_file() -> None:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["version"] == meshfix_cli.__version__
    names = {requirement.split(">")[0] for requirement in project["dependencies"]}
    assert names == {"numpy", "scipy", "meshio", "click", "rich"}
