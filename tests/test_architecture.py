"""The arrows of the design: which module may import which, and what must stay light."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import meshfix_cli

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "meshfix_cli"

ALLOWED = {
    "_kernels": {"_kernels_any"},
    "errors": set(),
    "mesh": {"_kernels", "errors"},
    "quality": {"_kernels", "mesh"},
    "obstacles": {"_kernels", "mesh"},
    "foldover": {"_kernels", "mesh"},
    "team": {"_kernels", "mesh"},
    "untangle": {"_kernels", "foldover", "mesh", "obstacles", "team"},
    "perturb": {"mesh"},
    "meshfile": {"_kernels", "errors", "mesh"},
    "report": {"mesh", "obstacles", "quality", "untangle"},
    "figures": {"_kernels", "mesh", "quality", "report", "untangle"},
    "page": {"figures", "mesh", "quality", "report"},
    "plot": {"errors", "figures", "mesh", "quality", "report"},
    "mpi": {"errors"},
    "dask": {"errors"},
    "distributed": {"_kernels", "errors", "mesh", "meshfile", "obstacles", "repair", "team", "untangle"},
    "repair": {"errors", "mesh", "meshfile", "obstacles", "perturb", "quality", "report", "team", "untangle"},
    "batch": {"errors", "meshfile", "repair", "report"},
    "cli": {
        "_kernels",
        "batch",
        "dask",
        "distributed",
        "errors",
        "figures",
        "mesh",
        "mpi",
        "meshfile",
        "page",
        "perturb",
        "plot",
        "quality",
        "repair",
        "report",
        "untangle",
        "__init__",
    },
    "__init__": {"mesh", "meshfile", "perturb", "quality", "untangle"},
    "__main__": {"cli"},
}
OWNERS = {
    "rich": {"report"}, "scipy": {"foldover"}, "meshio": {"meshfile"}, "click": {"cli"}, "distributed": {"dask"},
    "mpi4py": {"cli", "distributed", "mpi"}, "pymetis": {"distributed"}, "matplotlib": {"plot"},
}  # fmt: skip


def imports(path: Path) -> set[str]:
    """Full names of the modules a file imports, wherever the statement stands."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module == "meshfix_cli":
            found |= {f"meshfix_cli.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return found


def modules() -> dict[str, set[str]]:
    result: dict[str, set[str]] = {}
    for path in PACKAGE.rglob("*.py"):
        result.setdefault(path.relative_to(PACKAGE).parts[0].removesuffix(".py"), set()).update(imports(path))
    return result


def test_arrows_run_one_way() -> None:
    assert modules().keys() == ALLOWED.keys()
    for module, names in modules().items():
        own = {name.split(".")[1] for name in names if name.startswith("meshfix_cli.")} - {"__version__"}
        assert own - {module} <= ALLOWED[module], module


def test_each_heavy_package_has_one_importer() -> None:
    for package, owners in OWNERS.items():
        assert {module for module, names in modules().items() if package in {n.split(".")[0] for n in names}} == owners


def test_nothing_below_the_command_line_prints_exits_or_reads_the_environment() -> None:
    for path in PACKAGE.rglob("*.py"):
        if path.name in ("cli.py", "__main__.py"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in ("print", "exit", "quit"), path
            if isinstance(node, ast.Attribute):
                assert node.attr not in ("environ", "getenv", "exit"), path


@pytest.mark.parametrize("statement", ["import meshfix_cli", "import meshfix_cli.cli"])
def test_imports_are_light(statement: str) -> None:
    code = f"import sys; {statement}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/").stdout
    assert not {"numpy", "scipy", "meshio", "rich", "matplotlib"} & set(loaded.split())


def test_what_few_need_is_not_loaded_to_untangle(tmp_path: Path) -> None:
    sample = ROOT / "sample_meshes" / "plate_tangled.vtk"
    code = (
        "import sys; from meshfix_cli.cli import main\n"
        f"try: main(['untangle', '-q', {str(sample)!r}, {str(tmp_path / 'o.vtk')!r}])\n"
        "finally: print({'scipy', 'matplotlib', 'meshfix_cli.figures'} & sys.modules.keys())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd="/")
    assert (done.returncode, done.stdout.strip()) == (0, "set()")


def test_public_names_work_in_any_order_of_import() -> None:
    code = (
        "import meshfix_cli.untangle, meshfix_cli.cli; from meshfix_cli import *; print(callable(untangle), read, Mesh)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd="/")
    assert done.stdout.startswith("True <function read")


def test_every_public_function_has_a_docstring() -> None:
    for path in PACKAGE.rglob("*.py"):
        tree = ast.parse(path.read_text())
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{path.name}: {node.name}"


def test_version_and_dependencies_are_those_of_the_project_file() -> None:
    tomllib = pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["version"] == meshfix_cli.__version__
    names = {requirement.split(">")[0] for requirement in project["dependencies"]}
    assert names == {"numpy", "scipy", "meshio", "click", "rich"}
