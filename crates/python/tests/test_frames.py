"""Frames: held against `relight play`, against themselves, and against what light does."""

import json
import pathlib
from dataclasses import fields

import numpy as np
import pytest
import relight
from conftest import DATA, SMALL

MOVING = DATA / "cornell_moving.lights.json"
LAMPS = [
    relight.Point(position=(0.2, 0.4, 0.1), intensity=(1.0, 0.9, 0.7), name="lamp"),
    relight.Spot(position=(0.3, 0.5, 0.3), direction=(0, -1, -0.3), outer_angle_deg=40, intensity=3.0),
    relight.Sphere(center=(0.4, 0.45, 0.2), radius=0.05, radiance=np.array([4, 2, 1], dtype=np.float32)),
]


@pytest.fixture(scope="module")
def shot(asset):
    return asset.shot(size=(32, 24))


def test_frames_are_those_of_play_bit_by_bit(asset, command_line, tmp_path):
    command_line(
        "play", asset.path, "--lights", MOVING, "-o", tmp_path / "f_#.exr", "--size", "32x24", "--frames", "0-10x5",
        "--float", "--layers", "beauty,direct,indirect,lights,depth,normal", "--seed", "3",
    )  # fmt: skip
    shot = asset.shot(size=(32, 24))
    lights = asset.lights(MOVING)
    for time in [0, 5, 10]:
        played = relight.read_exr(tmp_path / f"f_{time}.exr")
        ours = shot.frame(lights, time, light_layers=True, surface_layers=True, seed=3)
        assert len(played) >= 6
        for name, image in played.items():
            np.testing.assert_array_equal(ours[name], image, err_msg=f"{name} at {time}")


def test_a_frame_is_arrays_by_layer(shot):
    frame = shot.frame(lights=LAMPS)
    assert list(frame) == ["beauty", "emission", "direct", "indirect", "A"]
    for name, image in frame.items():
        assert image.shape == ((24, 32) if name == "A" else (24, 32, 3)) and image.dtype == np.float32 and image.flags.c_contiguous, name
        # The user's own, to be written to.
        assert image.flags.writeable
    np.testing.assert_allclose(frame["beauty"], frame["emission"] + frame["direct"] + frame["indirect"], rtol=1e-6)
    assert frame["indirect"].max() > 0
    layers = shot.frame(lights=LAMPS, light_layers=True, surface_layers=True)
    surfaces = {"background", "albedo", "normal", "depth", "depth.ray"}
    assert {"light.lamp", "light.spot_1", "light.sphere_2"} | surfaces < set(layers)
    assert layers["depth"].shape == (24, 32)


def test_light_of_lights_adds_up_and_is_linear(shot):
    """Truth: light is linear in its sources."""
    basis = shot.basis(LAMPS)
    assert basis.shape == (3, 24, 32, 3) and basis.dtype == np.float32
    whole = shot.frame(lights=LAMPS)["beauty"]
    np.testing.assert_allclose(basis.sum(axis=0), whole, rtol=1e-4, atol=1e-5 * whole.max())
    weights = np.array([0.5, 0.0, 7.0])
    lit = [
        relight.Point(position=(0.2, 0.4, 0.1), intensity=0.5 * np.array([1.0, 0.9, 0.7]), name="lamp"),
        relight.Sphere(center=(0.4, 0.45, 0.2), radius=0.05, radiance=(28, 14, 7), name="sphere_2"),
    ]
    mixed = np.tensordot(weights, basis, axes=1)
    np.testing.assert_allclose(mixed, shot.frame(lights=lit)["beauty"], rtol=1e-3, atol=1e-4 * mixed.max())


def test_every_integrator_of_play_is_there(asset, command_line, tmp_path):
    """Truth: the command line, bit by bit."""
    lamp = tmp_path / "lamp.json"
    lamp.write_text(json.dumps({"relight_sequence": 1, "lights": [LAMPS[0].to_dict(), LAMPS[2].to_dict() | {"name": "globe"}]}))
    pictures = []
    for integrator, vpls in [("lightcuts", 0), ("lightcuts", 500), ("pixelcuts", 500), ("brute", 0), ("path", 0)]:
        frame = tmp_path / f"{integrator}_{vpls}.exr"
        more = ["--vpls", vpls] if vpls else []
        command_line(
            "play", asset.path, "--lights", lamp, "-o", frame, "--size", "16x12", "--float", "--spp", "2",
            "--integrator", integrator, *more,
        )  # fmt: skip
        ours = asset.shot(size=(16, 12), spp=2, integrator=integrator, vpls=vpls).frame(lights=lamp)["beauty"]
        np.testing.assert_array_equal(ours, relight.read_exr(frame)["beauty"], err_msg=f"{integrator} {vpls}")
        pictures.append(ours)
    assert pictures[1].sum() > 1.02 * pictures[0].sum(), "virtual lights bring indirect light"


def played_with(command_line, asset, materials):
    """Frame 4 of the moving lights, with these material edits, by the command line."""
    frames = materials.parent / "f_#.exr"
    command_line(
        "play", asset.path, "--lights", MOVING, "--materials", materials, "-o", frames, "--size", "32x24", "--frames",
        "4-4", "--float",
    )  # fmt: skip
    return relight.read_exr(materials.parent / "f_4.exr")["beauty"]


def test_materials_are_edited_as_play_edits_them(asset, command_line, tmp_path):
    """Truth: the command line, bit by bit; the asset itself stays as it was."""
    before = asset.shot(size=(32, 24)).frame(lights=LAMPS)["beauty"]
    edits = {
        "relight_materials": 1,
        "edits": [{"material": asset.materials[0], "base_color": {"keys": [[0, [0.9, 0.1, 0.1]], [8, [0.1, 0.1, 0.9]]]}}],
    }
    file = tmp_path / "edits.json"
    file.write_text(json.dumps(edits))
    played = played_with(command_line, asset, file)
    for form in [file, edits, json.dumps(edits), edits["edits"]]:
        edited = asset.edited(form, time=4)
        np.testing.assert_array_equal(edited.shot(size=(32, 24)).frame(MOVING, 4)["beauty"], played)
    np.testing.assert_array_equal(asset.shot(size=(32, 24)).frame(lights=LAMPS)["beauty"], before)
    with pytest.raises(relight.Error, match="nothing of that name"):
        asset.edited([{"material": "nothing of that name", "roughness": 1}])
    with pytest.raises(TypeError, match="materials"):
        asset.edited(7)


def varied(folder):
    """The box with a variant "dusk", in which what is white is shown in the green wall's material."""
    raw = (DATA / "cornell.glb").read_bytes()
    length = int.from_bytes(raw[12:16], "little")
    document = json.loads(raw[20 : 20 + length])
    names = [material["name"] for material in document["materials"]]
    document["extensionsUsed"] = [*document.get("extensionsUsed", []), "KHR_materials_variants"]
    document.setdefault("extensions", {})["KHR_materials_variants"] = {"variants": [{"name": "dusk"}]}
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            if names[primitive["material"]] == "White":
                mapping = {"variants": [0], "material": names.index("Green")}
                primitive["extensions"] = {"KHR_materials_variants": {"mappings": [mapping]}}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = raw[20 + length :]
    size = 20 + len(text) + len(rest)
    file = folder / "varied.glb"
    file.write_bytes(raw[:8] + size.to_bytes(4, "little") + len(text).to_bytes(4, "little") + b"JSON" + text + rest)
    return file


def test_a_variant_is_shown_as_play_shows_it(command_line, tmp_path):
    """Truth: the command line, bit by bit, and a bake of that variant alone for what the camera sees of the materials."""
    scene = varied(tmp_path)
    asset = relight.bake(scene, tmp_path / "varied.relight", **SMALL)
    edits = {"relight_materials": 1, "variant": "dusk", "edits": []}
    file = tmp_path / "dusk.json"
    file.write_text(json.dumps(edits))
    played = played_with(command_line, asset, file)
    plain = asset.shot(size=(32, 24)).frame(MOVING, 4)["beauty"]
    for form in [file, edits, json.dumps(edits)]:
        shown = asset.edited(form)
        np.testing.assert_array_equal(shown.shot(size=(32, 24)).frame(MOVING, 4)["beauty"], played)
    assert np.abs(plain - played).sum() > 0.1 * plain.sum(), "the variant changes what is seen"
    alone = relight.bake(scene, tmp_path / "alone.relight", variant="dusk", **SMALL)
    layers = [a.shot(size=(32, 24)).frame(MOVING, 4, surface_layers=True) for a in (asset.edited(edits), alone)]
    np.testing.assert_allclose(layers[0]["albedo"], layers[1]["albedo"], atol=1e-6)
    with pytest.raises(relight.Error, match="dusk"):
        asset.edited({"relight_materials": 1, "variant": "dawn", "edits": []})


def test_weather_shines_by_the_hour(asset, command_line, tmp_path):
    """Truth: the command line, bit by bit; the zenith is brighter at noon, when the sun is near it, than in the evening, and dark at night."""
    hours = "\n".join(f"6 21 {h + 0.5} {500 if 5 < h < 19 else 0} {100 if 5 < h < 19 else 0}" for h in range(24))
    file = tmp_path / "june.wea"
    file.write_text(
        "place Nowhere\nlatitude 47.4\nlongitude -8.5\ntime_zone -15\nsite_elevation 400\nweather_data_file_units 1\n" + hours
    )
    # Before the opening of the box, looking up.
    shot = asset.shot(relight.Camera(position=(0.28, 0.28, -0.7), look_at=(0.28, 5.0, -0.8)), size=(32, 24))
    lit = {hour: shot.frame(relight.Weather(file, hours=hour, day="06-21"))["beauty"].sum() for hour in (2, 12, 18)}
    assert lit[12] > 1.2 * lit[18] > 0 and lit[2] == 0
    keys = relight.Weather(file, hours=relight.Keys([(0, 11), (10, 13)]), day="06-21")
    np.testing.assert_array_equal(shot.frame(keys, 5)["beauty"], shot.frame(relight.Weather(file, 12.0, "06-21"))["beauty"])
    sequence = tmp_path / "weather.json"
    sequence.write_text(json.dumps({"relight_sequence": 1, "lights": [keys.to_dict() | {"name": "w", "file": "june.wea"}], "frames": 11}))
    command_line("play", asset.path, "--lights", sequence, "-o", tmp_path / "w.exr", "--size", "32x24", "--frames", "5-5", "--float")
    ours = asset.shot(size=(32, 24)).frame(sequence, 5)["beauty"]
    np.testing.assert_array_equal(ours, relight.read_exr(tmp_path / "w.exr")["beauty"])
    assert ours.max() > 0


def test_lights_are_taken_in_every_form(asset, shot):
    text = MOVING.read_text()
    forms = [MOVING, str(MOVING), text, json.loads(text), asset.lights(MOVING)]
    frames = [shot.frame(lights=form, time=3.5)["beauty"] for form in forms]
    for frame in frames[1:]:
        np.testing.assert_array_equal(frame, frames[0])
    lamp = {"type": "point", "position": [0.2, 0.4, 0.1], "intensity": [1, 1, 1]}
    np.testing.assert_array_equal(
        shot.frame(lights=[lamp])["beauty"], shot.frame(lights=relight.Point((0.2, 0.4, 0.1), 1.0))["beauty"]
    )
    assert shot.frame()["beauty"].max() > 0, "the scene's own lights"
    lights = asset.lights(LAMPS)
    assert lights.names == ["lamp", "spot_1", "sphere_2"] and len(lights) == 3 and lights.frames == 1


def test_classes_are_those_of_lighting_sequences():
    """Truth: the JSON Schema of sequences, which knows every kind of light and every field."""
    schema = json.loads((DATA.parent / "crates/format/schemas/sequence.schema.json").read_text())
    kinds = schema["$defs"]["Light"]["oneOf"]
    classes = {kind._type: kind for kind in relight.Light.__subclasses__()}
    known = {kind["properties"]["type"]["const"]: set(kind["properties"]) - {"type"} for kind in kinds}
    assert {name: {field.name for field in fields(kind)} for name, kind in classes.items()} == known
    camera = set(schema["$defs"]["Camera"]["properties"])
    assert {field.name for field in fields(relight.Camera)} | {"aspect"} == camera


def test_keys_move_lights(shot):
    lamp = relight.Point(relight.Keys([(0, (0.2, 0.4, 0.1)), (10, (0.4, 0.4, 0.1))]), intensity=1.0, name="lamp")
    for time, x in [(0, 0.2), (5, 0.3), (10, 0.4), (99, 0.4)]:
        still = relight.Point((x, 0.4, 0.1), intensity=1.0, name="lamp")
        np.testing.assert_allclose(shot.frame(lamp, time)["beauty"], shot.frame(still)["beauty"], rtol=1e-3, atol=1e-4)


def test_cameras_by_name_and_of_ones_own(asset):
    name = asset.cameras[0]
    named = asset.shot(name, (16, 12)).frame(LAMPS)["beauty"]
    np.testing.assert_array_equal(named, asset.shot(size=(16, 12)).frame(LAMPS)["beauty"])
    # Two ways to say the same, and one that looks elsewhere.
    own = relight.Camera(position=(0.1, 0.3, -0.6), look_at=(0.3, 0.2, 0.3), vfov_deg=50)
    there = asset.shot(own, (16, 12))
    assert there.size == (16, 12)
    shown = there.frame(LAMPS)["beauty"]
    np.testing.assert_array_equal(shown, asset.shot(own.to_dict(), (16, 12)).frame(LAMPS)["beauty"])
    assert np.abs(shown - named).max() > 0.01


def test_the_path_tracer_agrees(asset):
    """Truth: path tracing of the same scene; of a coarse bake, so that means are held against each other."""
    size, lamp = (24, 18), relight.Point((0.2, 0.4, 0.1), 1.0)
    relit = asset.shot(size=size).frame(lamp)
    traced = asset.shot(size=size, spp=256, integrator="path").frame(lamp)
    for name, bound in [("direct", 0.02), ("indirect", 0.15)]:
        assert abs(relit[name].mean() / traced[name].mean() - 1) < bound, name


def test_exr_files_hold_what_was_written(tmp_path):
    rng = np.random.default_rng(1)
    layers = {"beauty": rng.random((5, 7, 3), dtype=np.float32), "depth": rng.random((5, 7)).astype(np.float32)}
    relight.write_exr(tmp_path / "a.exr", layers)
    for name, image in relight.read_exr(tmp_path / "a.exr").items():
        np.testing.assert_array_equal(image, layers[name])
    relight.write_exr(tmp_path / "b.exr", layers["beauty"].astype(np.float64), float=False)
    np.testing.assert_allclose(relight.read_exr(tmp_path / "b.exr")["beauty"], layers["beauty"], rtol=1e-3)


def test_paths_come_back_as_paths(asset):
    assert isinstance(asset.path, pathlib.Path) and "relight.Asset" in repr(asset)
