"""Bodies read from STL files: what was written comes back, and what is no such body is refused in words."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from truespring.arrays import Floats
from truespring.errors import ReferenceFileError
from truespring.reference import read_stl

SIZE = (0.16, 0.04)
SINGLE = float(np.finfo(np.float32).eps)  # binary STL holds single precision


# --- bodies and files -----------------------------------------------------------------------------


def bending(elements: tuple[int, int] = (8, 2)) -> ts.Problem:
    return ts.Problem(
        mesh=ts.rectangle(SIZE, elements),
        material=ts.Material(young=10e3, poisson=1 / 3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.02))],
    )


@pytest.fixture(scope="module")
def bent() -> ts.Solution:
    path = ts.solve(bending(), ts.Springs(rule="lloyd"), ts.Newton(load_steps=2))
    assert np.abs(path.states[-1].displacement).max() > 0.25 * SIZE[0]
    return path


def flat(mesh: ts.Mesh, positions: Floats) -> Floats:
    """The facets of a plane body, two a quadrilateral, shape (n_facets, 3, 3)."""
    quads = np.pad(positions, ((0, 0), (0, 1)))[mesh.elements]
    return quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)


def solid(mesh: ts.Mesh, positions: Floats) -> Floats:
    """The facets of a solid 10 mm thick, thinner towards the right, its sides bulging and in two layers."""
    n = mesh.n_nodes
    half = 0.005 * (1 - mesh.nodes[:, :1])
    bulging = positions + 0.01 * (positions - positions.mean(axis=0))
    layers = ((positions, half), (positions, -half), (bulging, 0 * half))
    points = np.concatenate([np.hstack(layer) for layer in layers])
    top, bottom = mesh.elements, mesh.elements[:, ::-1] + n
    a, b = mesh.boundary.T
    upper = np.stack([a, a + 2 * n, b + 2 * n, b], axis=1)[:, ::-1]
    lower = np.stack([a + 2 * n, a + n, b + n, b + 2 * n], axis=1)[:, ::-1]
    quads = np.concatenate([lower[:3], top, bottom, upper, lower[3:]])  # the upper face is not the first
    return points[quads][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)


def binary(file: Path, facets: Floats, header: bytes = b"") -> Path:
    record = np.zeros(len(facets), dtype=[("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
    record["vertices"] = facets
    file.write_bytes(header.ljust(80, b" ") + len(facets).to_bytes(4, "little") + record.tobytes())
    return file


def solid_binary(file: Path, facets: Floats) -> Path:
    return binary(file, facets, b"solid of another program")


def ascii_text(facets: Floats, digits: str = ".17g", name: str = "body") -> str:
    lines = [f"solid {name}"]
    for facet in facets:
        lines += ["  facet normal 0 0 0", "    outer loop"]
        lines += ["      vertex " + " ".join(format(value, digits) for value in vertex) for vertex in facet]
        lines += ["    endloop", "  endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""])


def ascii_own(file: Path, facets: Floats) -> Path:
    file.write_text(ascii_text(facets), encoding="ascii")
    return file


def by_trimesh(kind: str) -> Callable[[Path, Floats], Path]:
    def write(file: Path, facets: Floats) -> Path:
        import trimesh

        faces = np.arange(3 * len(facets)).reshape(-1, 3)
        trimesh.Trimesh(facets.reshape(-1, 3), faces, process=False).export(file, file_type=kind)
        return file

    return write


WRITERS = {
    "binary": (binary, SINGLE),
    "binary that begins with solid": (solid_binary, SINGLE),
    "ASCII": (ascii_own, 1e-14),
    "binary by trimesh": (by_trimesh("stl"), SINGLE),
    "ASCII by trimesh": (by_trimesh("stl_ascii"), 1e-14),
}


# --- round trips ----------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [flat, solid])
@pytest.mark.parametrize("writer", WRITERS)
def test_what_was_solved_comes_back(
    bent: ts.Solution, tmp_path: Path, shape: Callable[[ts.Mesh, Floats], Floats], writer: str
) -> None:
    write, precision = WRITERS[writer]
    mesh, state = bent.problem.mesh, bent.states[-1]
    deformed = write(tmp_path / "deformed.stl", shape(mesh, state.positions))
    rest = write(tmp_path / "rest.stl", shape(mesh, mesh.nodes))
    path = read_stl(bent.problem, deformed, undeformed=rest)

    assert (path.label, path.kind, path.status) == ("deformed.stl", "stl", ts.Status.CONVERGED)
    assert len(path.warnings) == 1 and "stability not proven" in path.warnings[0]
    (read,) = path.states
    assert read.displacement == pytest.approx(state.displacement, abs=precision * SIZE[0])
    assert read.positions == pytest.approx(state.positions, abs=precision * SIZE[0])
    assert read.area_ratio == pytest.approx(state.area_ratio, rel=100 * precision)
    assert (read.load_factor, read.iterations, read.negative_eigenvalues, read.branched) == (1.0, 0, None, False)
    assert np.isnan(read.reaction).all() and np.isnan([read.energy, read.residual]).all() and read.stretch is None

    assert path.surface is not None
    assert len(path.surface.points) == mesh.n_nodes
    assert len(path.surface.triangles) == 2 * len(mesh.elements)
    comparison = ts.compare(bent, path)
    assert comparison.rms_error is not None and comparison.rms_error < 10 * precision
    assert comparison.surface is not None
    assert comparison.surface.outline_max < precision * SIZE[0]
    assert comparison.surface.nodes_max < precision * SIZE[0]


@pytest.mark.parametrize("shape", [flat, solid])
def test_without_the_body_at_rest_there_is_an_outline_only(
    bent: ts.Solution, tmp_path: Path, shape: Callable[[ts.Mesh, Floats], Floats]
) -> None:
    mesh, state = bent.problem.mesh, bent.states[-1]
    path = read_stl(bent.problem, binary(tmp_path / "a.stl", shape(mesh, state.positions)))
    assert path.states == () and path.status is ts.Status.CONVERGED
    assert path.surface is not None and len(path.surface.outline) == len(mesh.boundary)
    comparison = ts.compare(bent, path)
    assert comparison.surface is not None and comparison.surface.outline_max < SINGLE * SIZE[0]
    assert comparison.rms_error is None and comparison.agrees_up_to_load_factor is None


def test_load_factor_and_unit(bent: ts.Solution, tmp_path: Path) -> None:
    mesh, state = bent.problem.mesh, bent.states[1]
    deformed = ascii_own(tmp_path / "a.stl", flat(mesh, 1e3 * state.positions))
    rest = ascii_own(tmp_path / "b.stl", flat(mesh, 1e3 * mesh.nodes))
    path = read_stl(bent.problem, deformed, load_factor=0.5, undeformed=rest, unit="mm")
    assert path.load_factor == 0.5 and path.surface is not None and path.surface.load_factor == 0.5
    assert path.states[0].displacement == pytest.approx(state.displacement, abs=1e-14 * SIZE[0])
    comparison = ts.compare(bent, path)
    assert comparison.load_factors.tolist() == [0.5] and comparison.rms_errors[0] < 1e-13


def test_the_face_is_chosen_at_rest(bent: ts.Solution, tmp_path: Path) -> None:
    """Lifted towards the right, the lower face there lies above the middle and the upper face on the left below."""
    mesh, state = bent.problem.mesh, bent.states[-1]
    lifted = solid(mesh, state.positions)
    lifted[:, :, 2] += 0.1 * lifted[:, :, 0]
    rest = binary(tmp_path / "rest.stl", solid(mesh, mesh.nodes))
    (read,) = read_stl(bent.problem, binary(tmp_path / "a.stl", lifted), undeformed=rest).states
    assert read.displacement == pytest.approx(state.displacement, abs=SINGLE * SIZE[0])


def test_six_digits_are_enough_to_join_the_facets(bent: ts.Solution, tmp_path: Path) -> None:
    mesh, positions = bent.problem.mesh, bent.states[-1].positions
    (tmp_path / "a.stl").write_text(ascii_text(flat(mesh, positions), ".6e"), encoding="ascii")
    # The same vertex may also differ by its last digit from facet to facet.
    noise = 1e-8 * np.random.default_rng(7391).random((2 * len(mesh.elements), 3, 3)) * [1, 1, 0]
    ascii_own(tmp_path / "b.stl", flat(mesh, positions) + noise)
    for name in ("a.stl", "b.stl"):
        surface = read_stl(bent.problem, tmp_path / name).surface
        assert surface is not None and len(surface.points) == mesh.n_nodes
        assert len(surface.outline) == len(mesh.boundary)


@pytest.mark.parametrize(
    "name", ["vertex facet 1 2 3", "endsolid", "normal of a solid", "b\N{LATIN SMALL LETTER O WITH DIAERESIS}dy", ""]
)
def test_any_name_of_a_solid(bent: ts.Solution, tmp_path: Path, name: str) -> None:
    mesh = bent.problem.mesh
    facets = flat(mesh, mesh.nodes)
    text = ascii_text(facets[:20], name=name) + ascii_text(facets[20:], name=name)  # two solids
    for encoding in ("latin-1", "utf-8"):
        (tmp_path / "a.stl").write_bytes(text.replace("\n", "\r\n").upper().encode(encoding))
        surface = read_stl(bent.problem, tmp_path / "a.stl").surface
        assert surface is not None and len(surface.points) == mesh.n_nodes
        assert surface.points[surface.triangles].reshape(-1, 2) == pytest.approx(facets[:, :, :2].reshape(-1, 2))


def test_a_shell_with_both_its_sides_is_one_face(bent: ts.Solution, tmp_path: Path) -> None:
    mesh = bent.problem.mesh
    quads = np.pad(bent.states[-1].positions, ((0, 0), (0, 1)))[mesh.elements]
    back = quads[:, [[1, 0, 3], [1, 3, 2]]].reshape(-1, 3, 3)  # split along the other diagonal
    facets = np.concatenate([back, flat(mesh, bent.states[-1].positions)])
    surface = read_stl(bent.problem, binary(tmp_path / "a.stl", facets)).surface
    assert surface is not None and len(surface.outline) == len(mesh.boundary)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    st.tuples(*[st.integers(1, 9)] * 4),
    st.lists(st.floats(-0.3, 0.3), min_size=4, max_size=4),
    st.floats(0.01, 1.0),
)
def test_a_uniform_strain_comes_back_on_any_mesh(
    tmp_path_factory: pytest.TempPathFactory, counts: tuple[int, int, int, int], gradient: list[float], factor: float
) -> None:
    """Linear interpolation between the vertices of one mesh is exact at the nodes of any other."""
    strain = np.array(gradient).reshape(2, 2)
    strain[0, 0] += 0.5  # never no motion at all
    problem, other = bending(counts[:2]), ts.rectangle(SIZE, counts[2:])
    folder = tmp_path_factory.mktemp("stl")
    rest = ascii_own(folder / "rest.stl", solid(other, other.nodes))
    deformed = ascii_own(folder / "deformed.stl", solid(other, other.nodes + other.nodes @ strain.T))
    (state,) = read_stl(problem, deformed, factor, rest).states
    nodes = problem.mesh.nodes
    assert state.displacement == pytest.approx(nodes @ strain.T, abs=1e-13 * SIZE[0])
    assert state.area_ratio == pytest.approx(np.linalg.det(np.eye(2) + strain), rel=1e-10)


# --- warnings -------------------------------------------------------------------------------------


def test_another_unit_is_warned_of_or_refused(bent: ts.Solution, tmp_path: Path) -> None:
    mesh = bent.problem.mesh
    deformed = binary(tmp_path / "a.stl", flat(mesh, 1e3 * bent.states[-1].positions))
    rest = binary(tmp_path / "b.stl", flat(mesh, 1e3 * mesh.nodes))
    (_, warning) = read_stl(bent.problem, deformed).warnings
    assert "check unit" in warning and "(0.16, 0.04) m" in warning
    assert len(read_stl(bent.problem, deformed, unit="mm").warnings) == 1
    with pytest.raises(ReferenceFileError, match=r"b\.stl, read in m, lies .*\(160, 40\) m.*check unit"):
        read_stl(bent.problem, deformed, undeformed=rest)
    with pytest.raises(ReferenceFileError, match=r"b\.stl, read in um, lies .*check unit"):
        read_stl(bent.problem, deformed, undeformed=rest, unit="um")


def test_other_supports_and_another_body_are_warned_of(bent: ts.Solution, tmp_path: Path) -> None:
    mesh = bent.problem.mesh
    rest = binary(tmp_path / "rest.stl", flat(mesh, mesh.nodes))
    moved = binary(tmp_path / "moved.stl", flat(mesh, bent.states[-1].positions + np.array([0.01, 0.0])))
    (_, warning) = read_stl(bent.problem, moved, undeformed=rest).warnings
    assert "held by a support" in warning and "0.01 m" in warning
    longer = ts.rectangle((0.2, 0.04), (10, 2))
    rest = binary(tmp_path / "longer.stl", flat(longer, longer.nodes))
    pulled = binary(tmp_path / "pulled.stl", flat(longer, longer.nodes * [1.1, 1.0]))
    (_, warning) = read_stl(bent.problem, pulled, undeformed=rest).warnings
    assert "same body" in warning and "longer.stl" in warning


def test_prescribed_motion_is_no_other_support(tmp_path: Path) -> None:
    pulled = ts.Problem(
        mesh=ts.rectangle(SIZE, (4, 2)),
        material=ts.Material(young=10e3, poisson=1 / 3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left"), ts.Fixed(on="right", fix=["x"], displacement=[0.04, 0.0])],
    )
    nodes = pulled.mesh.nodes
    rest = binary(tmp_path / "rest.stl", flat(pulled.mesh, nodes))
    half = binary(tmp_path / "half.stl", flat(pulled.mesh, nodes * [1.125, 1.0]))
    assert len(read_stl(pulled, half, 0.5, rest).warnings) == 1
    assert "check supports, load_factor" in read_stl(pulled, half, 1.0, rest).warnings[1]


def test_an_inverted_body_has_not_converged(bent: ts.Solution, tmp_path: Path) -> None:
    mesh = bent.problem.mesh
    rest = binary(tmp_path / "rest.stl", flat(mesh, mesh.nodes))
    mirrored = binary(tmp_path / "mirrored.stl", flat(mesh, mesh.nodes * [1.0, -1.0]))
    path = read_stl(bent.problem, mirrored, undeformed=rest)
    assert path.status is ts.Status.INVERTED
    assert path.states[0].area_ratio == pytest.approx(-1, rel=1e-5)
    assert any("inverted" in warning and "-1" in warning for warning in path.warnings)


# --- what is refused ------------------------------------------------------------------------------

FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
WHOLE = f"solid a\n{FACET}{FACET}endsolid a\n"
RECORDS = b"\0" * 80 + (3).to_bytes(4, "little") + b"\1" * 150

BROKEN = {
    "empty": (b"", "is empty"),
    "blank": (b" \n\n", "is empty"),
    "no facet, binary": (b"\0" * 84, "no facet"),
    "no facet, ASCII": (b"solid a\nendsolid a\n", "no facet"),
    "truncated in the header": (b"\0" * 50, "truncated in its header"),
    "binary, truncated": (RECORDS[:-1], "truncated.*3 facets.*234 bytes.*233"),
    "binary that begins with solid, truncated": (b"solid" + RECORDS[5:-60], "truncated.*3 facets"),
    "binary, too long": (RECORDS + b"\0\0", "damaged.*234 bytes.*236"),
    "ASCII, truncated in a vertex": (WHOLE[:-60].encode(), "truncated.*of 6 'vertex'"),
    "ASCII, truncated after a facet": (f"solid a\n{FACET}".encode(), "truncated.*0 of 1 'endsolid'"),
    "ASCII, a facet not closed": (WHOLE.replace("endfacet", "", 1).encode(), "1 of 2 'endfacet'"),
    "ASCII, two coordinates": (WHOLE.replace("1 0 0", "1 0", 1).encode(), "three coordinates"),
    "ASCII, four coordinates": (WHOLE.replace("1 0 0", "1 0 0 0", 1).encode(), "three coordinates"),
    "ASCII, no number": (WHOLE.replace("1 0 0", "1 O 0", 1).encode(), "cannot be read"),
    "prose": (b"Dear reader, this is no mesh.\n" * 10, "no STL file"),
    "prose on solids": (b"solid ground is what we need\n" * 10, "no facet"),
    "a picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)), "no STL file"),
    "ASCII, four vertices and two": (
        WHOLE.replace("vertex 0 1 0\n", "", 1).replace("vertex 0 1 0\n", "vertex 0 1 0\n" * 2).encode(),
        "each of three vertices",
    ),
    "ASCII, a solid that ends before it begins": (
        f"solid a\n{FACET}endsolid a\nendsolid a\n{FACET}solid a\n".encode(),
        "do not follow in order",
    ),
    "NaN": (WHOLE.replace("1 0 0", "1 nan 0", 1).encode(), "not finite.*facet 1"),
    "infinite": (WHOLE.replace("1 0 0", "1 inf 0", 1).encode(), "not finite"),
    "no area": (WHOLE.replace("0 1 0", "2 0 0").encode(), "no area"),
    "one point": (WHOLE.replace("0 1 0", "0 0 0").replace("1 0 0", "0 0 0").encode(), "no area"),
    "in x and z": (WHOLE.replace("0 1 0", "0 0 1").encode(), "thinnest along y"),
    "in y and z": (WHOLE.replace("1 0 0", "0 0 1").encode(), "thinnest along x"),
    "a tilted sheet": (WHOLE.replace("0 1 0", "0 1 0.5").encode(), "constant z"),
    "one facet twice, turned": (
        (
            WHOLE[: -len(f"{FACET}endsolid a\n")] + FACET.replace("1 0 0\nvertex 0 1 0", "0 1 0\nvertex 1 0 0") * 2
        ).encode()
        + b"endsolid",
        "no outline",
    ),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_broken_file_is_refused(bent: ts.Solution, tmp_path: Path, fault: str) -> None:
    content, words = BROKEN[fault]
    file = tmp_path / "broken.stl"
    file.write_bytes(content)
    with pytest.raises(ReferenceFileError, match=rf"(?s)broken\.stl.*{words}") as refusal:
        read_stl(bent.problem, file)
    assert "export" in str(refusal.value)  # the way out


def test_any_cut_is_noticed(bent: ts.Solution, tmp_path: Path) -> None:
    mesh = bent.problem.mesh
    facets = flat(mesh, mesh.nodes)[:2]
    whole = [binary(tmp_path / "b.stl", facets).read_bytes(), ascii_text(facets, ".3g").rstrip().encode()]
    for content in whole:
        start = content.rfind(b"endsolid")
        name_only = range(start + len(b"endsolid"), len(content)) if start > 0 else range(0)
        for length in set(range(len(content))) - set(name_only):
            (tmp_path / "cut.stl").write_bytes(content[:length])
            with pytest.raises(ReferenceFileError, match=r"cut\.stl"):
                read_stl(bent.problem, tmp_path / "cut.stl")


def test_a_missing_file_and_a_folder_are_refused(bent: ts.Solution, tmp_path: Path) -> None:
    with pytest.raises(ReferenceFileError, match=r"none\.stl does not exist: check the path"):
        read_stl(bent.problem, tmp_path / "none.stl")
    with pytest.raises(ReferenceFileError, match="is a folder"):
        read_stl(bent.problem, tmp_path)
    whole = binary(tmp_path / "a.stl", flat(bent.problem.mesh, bent.problem.mesh.nodes))
    with pytest.raises(ReferenceFileError, match=r"rest\.stl does not exist"):
        read_stl(bent.problem, whole, undeformed=tmp_path / "rest.stl")


@pytest.mark.parametrize("unit", ["", "metre square", "kPa", "furlongs2", "0 m", "5", "m/s"])
def test_a_unit_of_no_length_is_refused(bent: ts.Solution, tmp_path: Path, unit: str) -> None:
    with pytest.raises(ReferenceFileError, match=r"a\.stl: unit = '.*'"):
        read_stl(bent.problem, tmp_path / "a.stl", unit=unit)


@pytest.mark.parametrize("load_factor", [0.0, -1.0, 1.5, float("nan")])
def test_a_load_factor_beyond_the_path_is_refused(bent: ts.Solution, tmp_path: Path, load_factor: float) -> None:
    with pytest.raises(ReferenceFileError, match=r"load_factor = .* above 0"):
        read_stl(bent.problem, tmp_path / "a.stl", load_factor)


def test_a_network_has_no_outline(tmp_path: Path) -> None:
    network = ts.SpringNetwork([[0.0, 1.0], [0.0, 0.0], [0.0, -1.0]], [[0, 1], [1, 2]], [1.0, 1.0], [1.0, 1.0])
    problem = ts.Problem(mesh=network.mesh, supports=[ts.Fixed(on=[0, 2])], loads=[ts.Force(on=[1], total=(1.0, 0.0))])
    with pytest.raises(ReferenceFileError, match="plane body of elements"):
        read_stl(problem, tmp_path / "a.stl")


def test_a_thin_solid_lying_on_its_side_is_refused(bent: ts.Solution, tmp_path: Path) -> None:
    facets = solid(bent.problem.mesh, bent.problem.mesh.nodes)[:, :, [0, 2, 1]]
    with pytest.raises(ReferenceFileError, match=r"thinnest along y.*z is its thickness"):
        read_stl(bent.problem, binary(tmp_path / "a.stl", facets))


def test_a_solid_without_its_lower_face_is_refused(bent: ts.Solution, tmp_path: Path) -> None:
    facets = solid(bent.problem.mesh, bent.problem.mesh.nodes)
    open_below = facets[~(facets[:, :, 2] < -0.001).all(axis=1)]
    assert len(open_below) == len(facets) - 2 * len(bent.problem.mesh.elements)
    with pytest.raises(ReferenceFileError, match="closed solid"):
        read_stl(bent.problem, binary(tmp_path / "a.stl", open_below))


def test_files_that_do_not_belong_together_are_refused(bent: ts.Solution, tmp_path: Path) -> None:
    mesh, positions = bent.problem.mesh, bent.states[-1].positions
    rest = binary(tmp_path / "rest.stl", flat(mesh, mesh.nodes))
    with pytest.raises(ReferenceFileError, match=r"a\.stl has 31 facets, .*rest\.stl has 32"):
        read_stl(bent.problem, binary(tmp_path / "a.stl", flat(mesh, positions)[:-1]), undeformed=rest)
    with pytest.raises(ReferenceFileError, match="have the same shape"):
        read_stl(bent.problem, rest, undeformed=rest)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.permutations(range(32)), st.integers(0, 31), st.integers(1, 2))
def test_facets_in_another_order_are_refused(
    bent: ts.Solution, tmp_path_factory: pytest.TempPathFactory, order: list[int], facet: int, turn: int
) -> None:
    mesh, positions = bent.problem.mesh, bent.states[-1].positions
    folder = tmp_path_factory.mktemp("stl")
    rest = binary(folder / "rest.stl", flat(mesh, mesh.nodes))
    facets = flat(mesh, positions)
    turned = facets.copy()
    turned[facet] = np.roll(turned[facet], turn, axis=0)  # the same facet, begun at another vertex
    others = [turned] if order == sorted(order) else [turned, facets[order]]
    for other in others:
        with pytest.raises(ReferenceFileError, match=r"rest\.stl at .* moves to two positions in .*different orders"):
            read_stl(bent.problem, binary(folder / "a.stl", other), undeformed=rest)


@pytest.mark.parametrize("off", [0.02, 0.0003])
def test_a_node_outside_of_the_body_is_named(bent: ts.Solution, tmp_path: Path, off: float) -> None:
    mesh, positions = bent.problem.mesh, bent.states[-1].positions
    shift = np.array([off, 0.0])
    rest = binary(tmp_path / "rest.stl", flat(mesh, mesh.nodes + shift))
    deformed = binary(tmp_path / "a.stl", flat(mesh, positions + shift))
    with pytest.raises(ReferenceFileError, match=rf"node \d+ at \(0, .*lies {off} m outside .*rest\.stl.*origin"):
        read_stl(bent.problem, deformed, undeformed=rest)


def test_a_node_hardly_outside_belongs_to_the_body(bent: ts.Solution, tmp_path: Path) -> None:
    """Off by less than a thousandth of the body: its displacement goes on linearly."""
    mesh = bent.problem.mesh
    smaller = mesh.nodes * [1 - 5e-4, 1.0]
    rest = ascii_own(tmp_path / "rest.stl", flat(mesh, smaller))
    deformed = ascii_own(tmp_path / "a.stl", flat(mesh, smaller * [1.2, 1.0]))
    (state,) = read_stl(bent.problem, deformed, undeformed=rest).states
    assert state.displacement == pytest.approx(mesh.nodes * [0.2, 0.0], abs=1e-14 * SIZE[0])
