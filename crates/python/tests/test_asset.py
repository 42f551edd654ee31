"""What an asset holds, held against what the command line says and exports."""

import json

import numpy as np
import pytest
import relight
from conftest import DATA, SMALL


def alike(a, b):
    """Whether JSON says the same, numbers to six digits: floats of 32 bits have as many."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(alike(a[name], b[name]) for name in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(alike, a, b))
    return a == pytest.approx(b, rel=1e-6) if isinstance(a, float) else a == b


def test_statistics_are_those_of_inspect(asset, command_line):
    said = json.loads(command_line("inspect", asset.path, "--json").stdout)
    ours = asset.statistics()
    assert ours["points"] == list(np.bincount(asset.points.level))
    assert set(ours) <= set(said)
    assert len(ours) > 25
    for name, value in ours.items():
        if name != "asset":
            assert alike(json.loads(json.dumps(value)), said[name]), name


def test_points_and_links_are_those_of_export(asset, command_line, tmp_path):
    for what in ["points", "links"]:
        command_line("export", asset.path, "--what", what, "-o", tmp_path)
    points = asset.points
    for name in ["positions", "normals", "albedo", "level", "widening", "disk_radius", "support_radius"]:
        exported, ours = np.load(tmp_path / f"{name}.npy"), getattr(points, name)
        assert ours.dtype == exported.dtype, name
        np.testing.assert_array_equal(ours, exported, err_msg=name)
        assert not ours.flags.writeable
    assert len(points) == len(points.level)
    senders = asset.senders
    np.testing.assert_array_equal(senders["counts"], np.load(tmp_path / "sender_counts.npy"))
    np.testing.assert_array_equal(senders["of_finest_point"], np.load(tmp_path / "sender_of_finest_point.npy"))
    np.testing.assert_array_equal(senders["importance"], np.load(tmp_path / "importance.npy"))
    for i, parents in enumerate(senders["parents"]):
        np.testing.assert_array_equal(parents, np.load(tmp_path / f"sender_parents_{i + 1}.npy"))
    assert asset.links["transfer"].shape == (len(points), senders["counts"].sum())
    links = asset.links
    assert list(links) == ["transfer", "bounce"]
    for name, matrix in links.items():
        data = "vectors" if name == "transfer" else "weights"
        for part, ours in [(data, matrix.data), ("columns", matrix.indices), ("row_offsets", matrix.indptr)]:
            np.testing.assert_array_equal(ours, np.load(tmp_path / f"{name}_{part}.npy"), err_msg=f"{name} {part}")
        assert len(matrix.indptr) == matrix.shape[0] + 1
        assert matrix.indices.max() < matrix.shape[1]


def test_links_are_shared_and_scipy_takes_them(asset):
    sparse = pytest.importorskip("scipy.sparse", reason="no scipy: CSR NOT handed to it")
    bounce = asset.links["bounce"]
    assert np.shares_memory(bounce.data, asset.links["bounce"].data)
    matrix = sparse.csr_array(bounce[:3], shape=bounce.shape)
    # SPEC 6.7: no row sends on more than arrives.
    assert matrix.nnz == len(bounce.data) and matrix.sum(axis=1).max() <= 1 + 1e-3


def test_a_bake_makes_what_the_command_makes(asset, command_line, tmp_path):
    other = tmp_path / "other.relight"
    options = [word for name, value in SMALL.items() for word in (f"--{name.replace('_', '-')}", value)]
    command_line("bake", DATA / "cornell.glb", "-o", other, *options)
    other = relight.open(other)
    for name, matrix in asset.links.items():
        for ours, theirs in zip(matrix, other.links[name]):
            np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(asset.points.positions, other.points.positions)
    assert asset.statistics()["settings"] == other.statistics()["settings"]
    assert asset.path.read_bytes() == other.path.read_bytes()


def test_a_bake_measures_itself_and_says_so_where_it_is_wrong(asset, command_line, tmp_path):
    said = json.loads(command_line("inspect", asset.path, "--json").stdout)
    ours = dict(asset.expected)
    assert ours.pop("text") == said["expected_error"]
    assert {**ours, "target": None} == pytest.approx(said["expected"])
    assert 0 < ours["error"] < 0.25
    options = {"preset": "draft", "levels": 1, "sender_levels": 1, "coarse_radius": 1.0, "epsilon": 50.0}
    with pytest.warns(relight.Warning, match="this asset is wrong.*leave --coarse-radius out"):
        bare = relight.bake(DATA / "cornell.glb", tmp_path / "bare.relight", **options)
    assert bare.expected["error"] > 1


def test_progress_is_told_and_what_it_raises_stops_the_bake(tmp_path):
    told = []

    def progress(stage, done, total):
        assert done >= 0 and (total is None or total > 0)
        told.append(stage)

    out = tmp_path / "a.relight"
    relight.bake(DATA / "cornell.glb", out, preset="draft", progress=progress)
    assert "refine" in told and out.is_file()

    class Enough(Exception):
        pass

    def enough(stage, done, total):
        raise Enough(stage)

    other = tmp_path / "b.relight"
    with pytest.raises(Enough):
        relight.bake(DATA / "cornell.glb", other, preset="draft", progress=enough)
    assert [path.name for path in tmp_path.iterdir()] == ["a.relight"]


def test_a_bake_for_lights_leaves_out_what_they_cannot_use(tmp_path):
    lamp = relight.Point(position=(0.2, 0.4, 0.1))
    asset = relight.bake(DATA / "cornell.glb", tmp_path / "a.relight", lights=[lamp], **SMALL)
    shot = asset.shot(size=(8, 6))
    with pytest.raises(relight.Error, match="left out of this asset"):
        shot.frame()
    assert shot.frame(lights=lamp)["indirect"].max() > 0


def test_a_log_of_another_bake_does_not_stay(tmp_path, command_line):
    out = tmp_path / "a.relight"
    command_line("bake", DATA / "cornell.glb", "-o", out, "--preset", "draft")
    log = tmp_path / "a.relight.log.json"
    assert log.is_file()
    relight.bake(DATA / "cornell.glb", out, **SMALL)
    assert not log.exists()
    log.write_text('{"mine": "schema"}')
    relight.bake(DATA / "cornell.glb", out, **SMALL)
    assert log.exists()
