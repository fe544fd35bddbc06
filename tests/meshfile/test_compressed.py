"""Files that gzip has compressed: read and written as what is in them; Python's own gzip is the oracle."""

from __future__ import annotations

import gzip
import io
import json
import zlib
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import TANGLED, VALID, error_line, on_terminal, results, run, statuses
from files_pvtu import slabs, split
from shapes import plate
from splicing import FORMATS, MODULES, make

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError, WriteError
from meshfix_cli.meshfile import compressed
from meshfix_cli.meshfile.compressed import unpacked

EACH = pytest.mark.parametrize("form", FORMATS)


def named(data: bytes, path: Path, level: int = 9) -> Path:
    """Compress as gzip does, with a name and a time."""
    with path.open("wb") as out, gzip.GzipFile("mesh of 2024", "wb", level, out, mtime=1.7e9) as stream:
        stream.write(data)
    return path


def first(form: str, folder: Path) -> Path:
    return make(form, next(iter(MODULES[form].FILES)), folder)


@EACH
def test_a_compressed_file_is_what_is_in_it(form: str, tmp_path: Path) -> None:
    path = first(form, tmp_path)
    packed = named(path.read_bytes(), tmp_path / f"in{path.suffix}.gz")
    plain, document = read(path), read(packed)
    assert document.format == plain.format
    after = untangle(plain.mesh).after
    write(plain, after, tmp_path / "expected")
    expected = (tmp_path / "expected").read_bytes()
    assert expected != path.read_bytes()
    names = [f"out{path.suffix}.gz", "out.GZ", f"again{path.suffix}.gz", packed.name]
    for name in names:
        write(document, after, tmp_path / name)
        assert gzip.decompress((tmp_path / name).read_bytes()) == expected
        assert (tmp_path / name).read_bytes() == (tmp_path / names[0]).read_bytes()
    write(document, after, tmp_path / f"plain{path.suffix}")
    assert (tmp_path / f"plain{path.suffix}").read_bytes() == expected
    write(plain, after, tmp_path / f"new{path.suffix}.gz")
    assert (tmp_path / f"new{path.suffix}.gz").read_bytes() == (tmp_path / names[0]).read_bytes()


def test_streams_are_compressed_as_they_come(tmp_path: Path) -> None:
    packed = named(Path(TANGLED).read_bytes(), tmp_path / "in.vtk.gz")
    run("untangle", "-q", packed, tmp_path / "out.vtk.gz")
    expected = (tmp_path / "out.vtk.gz").read_bytes()
    assert run("untangle", "-q", data=packed.read_bytes()).stdout == expected
    assert run("untangle", "-q", packed).stdout == expected
    assert run("untangle", "-q", TANGLED).stdout == gzip.decompress(expected)
    code, shown = on_terminal("untangle", "-q", packed, "-")
    assert code == 2
    assert "binary data is not written to a terminal" in shown


@EACH
def test_a_mesh_that_did_not_move_keeps_its_compressed_bytes(form: str, tmp_path: Path) -> None:
    path = first(form, tmp_path)
    packed = named(path.read_bytes(), tmp_path / f"in{path.suffix}.gz", 1)
    document = read(packed)
    write(document, document.mesh, tmp_path / f"out{path.suffix}.gz")
    assert (tmp_path / f"out{path.suffix}.gz").read_bytes() == packed.read_bytes()
    write(document, document.mesh, tmp_path / f"out{path.suffix}")
    assert (tmp_path / f"out{path.suffix}").read_bytes() == path.read_bytes()


@pytest.mark.parametrize("suffix", [".off", ".bdf"])
def test_formats_that_meshio_reads(suffix: str, tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    mesh.write(tmp_path / f"in{suffix}")
    packed = named((tmp_path / f"in{suffix}").read_bytes(), tmp_path / f"in{suffix}.gz")
    assert read(packed).mesh.topology.m == len(mesh.cells[0].data)
    run("untangle", "-q", "--only-invalid", packed, tmp_path / f"out{suffix}.gz")
    assert (tmp_path / f"out{suffix}.gz").read_bytes() == packed.read_bytes()
    run("untangle", "-q", TANGLED, tmp_path / f"new{suffix}.gz")
    assert read(tmp_path / f"new{suffix}.gz").mesh.check()[0] == 0


def test_the_content_tells_and_then_the_name_before_the_last_dot(tmp_path: Path) -> None:
    odd = named(Path(TANGLED).read_bytes(), tmp_path / "odd.vtk")
    before = odd.read_bytes()
    run("untangle", "-q", odd, odd)
    assert odd.read_bytes() != before
    assert compressed.is_compressed(odd.read_bytes())  # in its place a file is what it was
    plain = tmp_path / "plain.vtk.gz"
    plain.write_bytes(Path(VALID).read_bytes())
    run("untangle", "-q", plain, plain)
    assert plain.read_bytes().startswith(b"# vtk")
    text = tmp_path / "headless.msh.gz"
    named(b"ISO-10303-21;\nHEADER;\n", text)
    assert "is a file of STEP" in error_line("quality", text)


def test_a_conversion_is_compressed_by_its_name(tmp_path: Path) -> None:
    packed = named(Path(TANGLED).read_bytes(), tmp_path / "in.vtk.gz")
    told = json.loads(run("untangle", "--json", packed, tmp_path / "out.msh.gz").stdout)
    assert "converted from vtk42 to gmsh22" in " ".join(told["notes"])
    data = gzip.decompress((tmp_path / "out.msh.gz").read_bytes())
    assert data.startswith(b"$MeshFormat\n2.2")
    run("untangle", "-q", packed, tmp_path / "out.msh")
    assert (tmp_path / "out.msh").read_bytes() == data
    assert gzip.decompress(run("untangle", "-q", "--format", "gmsh22", packed, "-").stdout) == data
    told = json.loads(run("untangle", "--json", packed, tmp_path / "out.xyz.gz").stdout)
    assert f"{tmp_path / 'out.xyz.gz'}: the extension .xyz is not known" in " ".join(told["notes"])


def test_the_same_mesh_gives_the_same_bytes_at_any_time(tmp_path: Path) -> None:
    run("untangle", "-q", TANGLED, tmp_path / "a.vtk.gz")
    data = (tmp_path / "a.vtk.gz").read_bytes()
    assert data[3:8] == bytes(5)  # no name, no time
    assert gzip.GzipFile(fileobj=io.BytesIO(data)).read().startswith(b"# vtk")
    assert len(data) < 0.6 * len(gzip.decompress(data))


def test_a_backup_is_the_compressed_file(tmp_path: Path) -> None:
    packed = named(Path(TANGLED).read_bytes(), tmp_path / "in.vtk.gz")
    before = packed.read_bytes()
    run("untangle", "-q", "--backup", packed, packed)
    assert (tmp_path / "in.vtk.gz.bak").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.vtk.gz", "in.vtk.gz.bak"]


def test_double_and_orientation(tmp_path: Path) -> None:
    """What is changed in the file otherwise is not given back as it was."""
    valid = meshio.read(VALID)
    mirrored = meshio.Mesh(valid.points.astype("f4"), [("triangle", valid.cells[0].data[:, ::-1])])
    mirrored.write(tmp_path / "in.vtk", file_format="vtk42", binary=True)
    packed = named((tmp_path / "in.vtk").read_bytes(), tmp_path / "in.vtk.gz")
    for option in ("--double", "--fix-orientation"):
        run("untangle", "-q", option, tmp_path / "in.vtk", tmp_path / "plain.vtk")
        run("untangle", "-q", option, packed, tmp_path / "out.vtk.gz")
        assert gzip.decompress((tmp_path / "out.vtk.gz").read_bytes()) == (tmp_path / "plain.vtk").read_bytes()
        assert (tmp_path / "plain.vtk").read_bytes() != (tmp_path / "in.vtk").read_bytes()


def test_processes_do_not_write_into_a_compressed_file(tmp_path: Path) -> None:
    document = read(make("vtk", "meshio_42.vtk", tmp_path))

    def put(*_: object) -> None:
        raise AssertionError

    write(document, document.mesh, tmp_path / "out.vtk.gz", put=put)
    assert unpacked((tmp_path / "out.vtk.gz").read_bytes()) == Path(document.name).read_bytes()


def test_a_batch_of_compressed_files(tmp_path: Path) -> None:
    for name in ("a.vtk.gz", "b.vtk.gz"):
        named(Path(TANGLED).read_bytes(), tmp_path / name)
    (tmp_path / "c.vtk.gz").write_bytes((tmp_path / "a.vtk.gz").read_bytes()[:500])
    arguments = ["batch", "--json", "--resume", "--output-dir", tmp_path / "out", str(tmp_path / "*.gz")]
    done = run(*arguments, code=4)
    assert statuses(done) == {"a.vtk.gz": "valid", "b.vtk.gz": "valid", "c.vtk.gz": "failed"}
    assert "is truncated" in results(done)["c.vtk.gz"]["error"]
    data = [(tmp_path / "out" / name).read_bytes() for name in ("a.vtk.gz", "b.vtk.gz")]
    assert data[0] == data[1]
    assert gzip.decompress(data[0]).startswith(b"# vtk")
    assert statuses(run(*arguments, code=4))["a.vtk.gz"] == "skipped"


class TestWhatIsInIt:
    """`unpacked` against Python's own gzip."""

    def test_several_members_and_zeros_behind_them(self) -> None:
        text = np.random.default_rng(1).integers(0, 9, 200_000).astype("u1").tobytes()
        members = b"".join(gzip.compress(text[at : at + 7000]) for at in range(0, len(text), 7000))
        assert unpacked(members) == unpacked(members + bytes(700)) == gzip.decompress(members) == text

    def test_what_is_damaged_is_refused(self) -> None:
        data = gzip.compress(Path(TANGLED).read_bytes())
        for at in range(2, len(data), 97):
            with pytest.raises(ReadError, match="is truncated"):
                unpacked(data[:at])
        refused = 0
        for at in range(10, len(data), 53):
            broken = bytearray(data)
            broken[at] ^= 0x41
            with pytest.raises(ReadError, match=r"is damaged|is truncated|something else"):
                unpacked(bytes(broken))
            refused += 1
        assert refused > 50
        with pytest.raises(ReadError, match="behind its end is something else"):
            unpacked(data + b"more")
        with pytest.raises(ReadError, match="is damaged"):
            unpacked(data + compressed.MAGIC + b"no member")

    def test_a_file_in_which_there_is_another_compressed_one(self, tmp_path: Path) -> None:
        once = gzip.compress(Path(TANGLED).read_bytes())
        (tmp_path / "in.vtk.gz.gz").write_bytes(gzip.compress(once))
        assert "is compressed twice; unpack it once" in error_line("quality", tmp_path / "in.vtk.gz.gz")
        (tmp_path / "empty.vtk.gz").write_bytes(gzip.compress(b""))
        assert "is empty" in error_line("quality", tmp_path / "empty.vtk.gz")

    def test_memory_has_a_bound(self, monkeypatch: pytest.MonkeyPatch) -> None:
        packer = zlib.compressobj(9, wbits=31)
        bomb = b"".join(packer.compress(bytes(1 << 20)) for _ in range(70)) + packer.flush()
        with pytest.raises(ReadError, match="would be more than 67,108,864 bytes when it is unpacked"):
            unpacked(bomb)
        monkeypatch.setattr(compressed, "FLOOR", 0)
        with pytest.raises(ReadError, match="would be more than"):
            unpacked(gzip.compress(bytes(1 << 20)))
        text = Path(TANGLED).read_bytes()
        assert unpacked(gzip.compress(text)) == text


def test_a_mesh_in_several_files_is_not_compressed(tmp_path: Path) -> None:
    points, cells = plate()
    index = tmp_path / "in.pvtu"
    split(index, points, cells, slabs(points, cells, 2), mode="Ascii")
    named(index.read_bytes(), tmp_path / "other.pvtu.gz")
    assert "is compressed, and a mesh in several files" in error_line("quality", tmp_path / "other.pvtu.gz")
    document = read(index)
    with pytest.raises(WriteError, match=r"several files is not compressed; name an OUTPUT without \.gz"):
        write(document, document.mesh, tmp_path / "out.pvtu.gz")
    write(document, document.mesh, tmp_path / "out.vtu.gz")
    assert read(tmp_path / "out.vtu.gz").mesh.topology.m == len(cells)
    named((tmp_path / "in_1.vtu").read_bytes(), tmp_path / "in_1.vtu")
    assert "in_1.vtu: is compressed" in error_line("quality", index)
