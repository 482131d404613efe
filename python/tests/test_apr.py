"""The binding gives the command line's bits, and says what is wrong with an array."""

import errno
import importlib.metadata
import inspect
import json
import multiprocessing
import os
import pathlib
import re
import signal
import subprocess
import threading
import types
import typing

import numpy as np
import pytest

import apr

ROOT = pathlib.Path(__file__).resolve().parents[2]
CYCLES = ROOT / "fixtures/blender/room_seed1.exr"
SECOND = ROOT / "fixtures/blender/room_seed2.exr"
TRACED = ROOT / "fixtures/trace/teapot_specular.exr"
PROGRAM = os.environ.get("APR_DENOISE")  # the command line; its tests are skipped without it


def picture(height=20, width=27, seed=0):
    random = np.random.default_rng(seed)
    truth = np.linspace(0.2, 1.0, width, dtype=np.float32)[None, :, None] * np.ones((height, 1, 3), np.float32)
    return truth + 0.1 * random.standard_normal(truth.shape).astype(np.float32), truth


def same(a, b):
    return a.dtype == b.dtype and a.shape == b.shape and np.array_equal(a, b, equal_nan=True)


def same_pictures(a, b):
    # The program also writes down its settings, so that the files differ in an attribute.
    a, b = (apr.read_exr(path, aovs=["auto"]) for path in (a, b))
    def parts(p):
        return {"color": p["color"], **(p.get("aovs") or {})}

    a, b = parts(a), parts(b)
    return a.keys() == b.keys() and all(same(a[name], b[name]) for name in a)


def by_program(folder, *arguments):
    if not PROGRAM:
        pytest.skip("APR_DENOISE does not name the command line")
    output = folder / "program.exr"
    subprocess.run([PROGRAM, *map(str, arguments[:1]), output, "--quiet", *map(str, arguments[1:])], check=True)
    return output


def test_noise_falls_and_the_result_has_its_parts():
    noisy, truth = picture()
    result = apr.denoise(noisy, variance=np.full_like(noisy, 0.01))
    assert result["color"].shape == (20, 27, 3) and result["color"].dtype == np.float32
    assert result["mse"].shape == (20, 27) and (result["mse"] >= 0).all()
    assert np.square(result["color"] - truth).mean() < 0.2 * np.square(noisy - truth).mean()
    assert result["summary"]["centres"] > 0


@pytest.mark.parametrize("source", [TRACED, CYCLES])
def test_arrays_give_the_command_lines_bits(tmp_path, source):
    output = by_program(tmp_path, source)
    keywords = apr.read_exr(source)
    assert keywords["features"], "the fixture has features"
    result = apr.denoise(**keywords)
    if source == TRACED:  # 32-bit floats; Blender's file has halves and another layer for the result
        assert same(result["color"], apr.read_exr(output)["color"])
    apr.denoise_exr(source, tmp_path / "binding.exr")
    assert same_pictures(tmp_path / "binding.exr", output)


def test_light_groups_two_seeds_and_options_give_the_command_lines_bits(tmp_path):
    output = by_program(tmp_path, CYCLES, "--half", SECOND, "--aov", "auto", "--aux",
                        "--preset", "fast", "--set", "outliers.enabled=false")
    report = apr.denoise_exr(CYCLES, tmp_path / "binding.exr", half=SECOND, aovs=["auto"], aux=True,
                             preset="fast", options={"outliers.enabled": False}, threads=1)
    assert same_pictures(tmp_path / "binding.exr", output)
    assert report["sums"][0]["after"]["relative_rms"] < 5e-4


def moving(folder, frames=3):
    """Writes frames of a texture that moves to the right by two columns a frame, as shot.0001.exr and so on."""
    random = np.random.default_rng(5)
    texture = random.random((20, 60, 1)).astype(np.float32) + np.zeros(3, np.float32)
    vectors = lambda columns: np.full((20, 27, 2), [columns, 0], np.float32)
    for i in range(frames):
        albedo = texture[:, 10 - 2 * i:37 - 2 * i]
        noise = 0.2 * albedo * random.standard_normal(albedo.shape).astype(np.float32)
        apr.write_exr(folder / f"shot.{i + 1:04}.exr", albedo + noise, variance=(0.2 * albedo) ** 2, albedo=albedo,
                      motion_previous=vectors(-2), motion_next=vectors(2), seed=i)
    return texture[:, 8:35]


def test_frames_beside_give_the_command_lines_bits_and_less_noise(tmp_path):
    truth = moving(tmp_path)
    first, frame, last = (apr.read_exr(tmp_path / f"shot.{i:04}.exr", motion=True) for i in (1, 2, 3))
    assert frame["motion_next"].shape == (20, 27, 2) and "motion_next" not in apr.read_exr(tmp_path / "shot.0002.exr")
    alone = apr.denoise(**frame)
    together = apr.denoise(**frame, before=[first], after=[last])
    error = lambda result: np.square(result["color"] - truth).mean()
    assert error(together) < 0.8 * error(alone)
    # The frame comes first: what is beside it is found by its vectors.
    still = apr.denoise(**{**frame, "motion_previous": None, "motion_next": None}, before=[first], after=[last])
    assert error(together) < error(still)
    apr.write_exr(tmp_path / "again.exr", **frame)
    assert same(apr.read_exr(tmp_path / "again.exr", motion=True)["motion_next"], frame["motion_next"])
    if not PROGRAM:
        pytest.skip("APR_DENOISE does not name the command line")
    outputs = tmp_path / "den.####.exr"
    command = [PROGRAM, tmp_path / "shot.####.exr", outputs, "--frames", "2", "--temporal", "1", "--quiet"]
    subprocess.run(list(map(str, command)), check=True)
    assert same(together["color"], apr.read_exr(tmp_path / "den.0002.exr")["color"])


def test_features_keep_their_order_and_so_the_command_lines_bits(tmp_path):
    noisy, _ = picture()
    render = tmp_path / "render.exr"
    apr.write_exr(render, noisy, layers={"a": noisy[..., 0] ** 2, "b": noisy[..., 1] * noisy[..., 2]})
    assert list(apr.read_exr(render, features={"b": "b.Y", "a": "a.Y"})["features"]) == ["b", "a"]
    output = by_program(tmp_path, render, "--feature", "b=b.Y", "--feature", "a=a.Y")
    apr.denoise_exr(render, tmp_path / "binding.exr", features={"b": "b.Y", "a": "a.Y"})
    assert same_pictures(tmp_path / "binding.exr", output)


def test_the_command_line_knows_what_the_binding_wrote(tmp_path):
    apr.denoise_exr(TRACED, tmp_path / "program.exr", preset="fast")
    by_program(tmp_path, TRACED)  # it replaces results, but no renders


def test_components_sum_to_the_beauty():
    noisy, _ = picture()
    part = noisy * np.random.default_rng(1).random(noisy.shape, np.float32)
    result = apr.denoise(noisy, aovs={"diffuse": part, "rest": noisy - part})
    total = result["aovs"]["diffuse"] + result["aovs"]["rest"]
    assert np.abs(total - result["color"]).max() < 1e-5


def test_any_layout_of_the_numbers_gives_the_same_bits():
    noisy, _ = picture()
    plain = apr.denoise(noisy)["color"]
    padded = np.zeros((20, 27, 4), np.float32)
    padded[..., :3] = noisy
    untouched = noisy.copy()
    for other in (np.asfortranarray(noisy), padded[..., :3], noisy.astype(np.float64), noisy[::-1][::-1]):
        assert same(apr.denoise(other)["color"], plain)
    assert same(apr.denoise(noisy, threads=1)["color"], apr.denoise(noisy, threads=3)["color"])
    assert same(noisy, untouched)


def test_a_miss_of_the_depth_is_bounded_as_in_files():
    noisy, _ = picture()
    depth = np.linspace(1, 2, 20 * 27, dtype=np.float32).reshape(20, 27)
    bounded = depth.copy()
    depth[3, 4], bounded[3, 4] = 1e10, depth.max()
    result = apr.denoise(noisy, depth=depth)
    assert same(result["color"], apr.denoise(noisy, depth=bounded)["color"])
    assert any("misses" in note for note in result["summary"]["notes"])


def test_files_are_written_and_read_back(tmp_path):
    noisy, _ = picture()
    path = tmp_path / "a b.exr"
    apr.write_exr(path, noisy, layers={"albedo": noisy * 0.5, "depth": noisy[..., 0]}, spp=16, seed=3)
    back = apr.read_exr(str(path), map={"depth": "depth"})
    assert same(back["color"], noisy) and same(back["features"]["depth"], noisy[..., 0]) and back["spp"] == 16
    layout = apr.inspect_exr(path)
    assert {"color", "albedo", "depth"} <= {role["role"] for role in layout["roles"]}
    json.dumps(layout)


def test_no_file_that_is_read_is_lost(tmp_path):
    noisy, _ = picture()
    a, b = tmp_path / "a.exr", tmp_path / "b.exr"
    apr.write_exr(a, noisy)
    apr.write_exr(b, picture(seed=1)[0])
    before = b.read_bytes()
    for reading in ({"half": b}, {"further": [b]}):
        with pytest.raises(ValueError, match="b.exr"):
            apr.denoise_exr(a, b, **reading)
    with pytest.raises(ValueError, match="exr"):
        apr.denoise_exr(a, tmp_path / "c.png")
    with pytest.raises(ValueError, match="exr"):
        apr.write_exr(tmp_path / "c.png", noisy)
    assert b.read_bytes() == before and sorted(tmp_path.iterdir()) == [a, b]
    apr.denoise_exr(a, a)
    assert not same(apr.read_exr(a)["color"], noisy), "in place"


def test_mappings_pairs_and_numbers_of_numpy_are_taken():
    noisy, _ = picture()
    plain = apr.denoise(noisy, halves=(0.9 * noisy, 1.1 * noisy), features={"x": noisy}, options={"window_radius": 5})
    frozen = types.MappingProxyType
    for halves in ([0.9 * noisy, 1.1 * noisy], np.stack([0.9 * noisy, 1.1 * noisy])):
        other = apr.denoise(noisy, halves=halves, features=frozen({"x": noisy}),
                            options=frozen({"window_radius": np.int64(5)}))
        assert same(plain["color"], other["color"])


def test_halves_of_another_picture_are_told():
    noisy, _ = picture()
    notes = [apr.denoise(noisy, halves=(k * noisy, k * noisy + 0.01))["summary"]["notes"] for k in (1, 6)]
    assert [any("average of halves" in note for note in some) for some in notes] == [False, True]


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork here")
def test_a_forked_process_denoises_too(tmp_path):
    noisy, _ = picture()
    path = tmp_path / "a.exr"

    def work():
        apr.denoise(noisy)
        apr.write_exr(path, noisy)
        apr.read_exr(path)

    work()
    child = multiprocessing.get_context("fork").Process(target=work)
    child.start()
    child.join(20)
    hangs = child.is_alive()
    child.kill()
    assert not hangs and child.exitcode == 0


@pytest.mark.parametrize("error, words, call", [
    (ValueError, r"\(20, 27, 4\).*alpha", lambda c: apr.denoise(np.concatenate([c, c[..., :1]], 2))),
    (ValueError, r"\(20, 27\).*height, width, 3", lambda c: apr.denoise(c[..., 0])),
    (ValueError, r"variance.*\(19, 27\).*\(20, 27\)", lambda c: apr.denoise(c, variance=c[1:])),
    (ValueError, r"depth.*\(20,?\)", lambda c: apr.denoise(c, depth=np.zeros(20))),
    (ValueError, "no feature", lambda c: apr.denoise(c, feature_variance={"albedo": c})),
    (ValueError, r"\['albedo'\].*\(19, 27\)", lambda c: apr.denoise(c, albedo=c, feature_variance={"albedo": c[1:]})),
    (ValueError, "2 planes where 3", lambda c: apr.denoise(c, albedo=2 + c, feature_halves={"albedo": (c, c[..., :2])})),
    (ValueError, "twice", lambda c: apr.denoise(c, albedo=c, features={"albedo": c})),
    (ValueError, "balanced", lambda c: apr.denoise(c, preset="magic")),
    (ValueError, "max_order", lambda c: apr.denoise(c, options={"maxorder": 1})),
    (ValueError, "threads", lambda c: apr.denoise(c, threads=0)),
    (ValueError, "1 to 1024", lambda c: apr.denoise(c, threads=1025)),
    (ValueError, "1 to 1024", lambda c: apr.denoise_exr(CYCLES, "a.exr", threads=-1)),
    (ValueError, "spp is 0", lambda c: apr.denoise(c, spp=0)),
    (ValueError, "spp is inf", lambda c: apr.read_exr(CYCLES, spp=float("inf"))),
    (ValueError, "spp is NaN", lambda c: apr.write_exr("a.exr", c, spp=float("nan"))),
    (ValueError, r"options\['risk_power'\].*nan", lambda c: apr.denoise(c, options={"risk_power": float("nan")})),
    (ValueError, r"layers\['d'\].*\(5, 5\).*\(20, 27\)",
     lambda c: apr.write_exr("a.exr", c, layers={"d": np.zeros((5, 5))})),
    (ValueError, "pixel", lambda c: apr.denoise(c[:0])),
    (ValueError, "motion_next has 3 channels where 2", lambda c: apr.denoise(c, motion_next=c)),
    (ValueError, r"before\[0\]: there is no color", lambda c: apr.denoise(c, before=[{"albedo": c}])),
    (ValueError, r"after\[1\]: 'preset'", lambda c: apr.denoise(c, after=[{"color": c}, {"color": c, "preset": "best"}])),
    (ValueError, r"after\[0\]: variance.*\(19, 27\)", lambda c: apr.denoise(c, after=[{"color": c, "variance": c[1:]}])),
    (TypeError, "complex", lambda c: apr.denoise(c * 1j)),
    (TypeError, "str", lambda c: apr.denoise("render.exr")),
    (TypeError, "pair", lambda c: apr.denoise(c, albedo=c, feature_halves={"albedo": 3})),
    (TypeError, "sequences", lambda c: apr.read_exr(CYCLES, aovs="auto")),
    (FileNotFoundError, "nowhere.exr", lambda c: apr.read_exr("nowhere.exr")),
    (FileNotFoundError, "no folder", lambda c: apr.denoise_exr(CYCLES, ROOT / "no folder" / "a.exr")),
    (OSError, "Cargo.toml", lambda c: apr.read_exr(ROOT / "Cargo.toml")),
    (FileNotFoundError, "no folder", lambda c: apr.write_exr(ROOT / "no folder" / "a.exr", c)),
    (ValueError, "profile", lambda c: apr.read_exr(CYCLES, profile="povray")),
    (ValueError, "; apr.inspect_exr without map", lambda c: apr.read_exr(CYCLES, aovs=["Combined_moon"])),
    (ValueError, " map ", lambda c: apr.read_exr(CYCLES, map={"albedo": "moon"})),
    (ValueError, "this name.*rename", lambda c: apr.write_exr("a.exr", c, aovs={"x": c}, layers={"x": c})),
])
def test_errors_are_pythons_and_say_what_is_wrong(error, words, call):
    with pytest.raises(error, match=words):
        call(picture()[0])


def test_errors_of_files_have_their_number_and_name():
    with pytest.raises(FileNotFoundError) as raised:
        apr.read_exr("nowhere.exr")
    assert raised.value.errno == errno.ENOENT and raised.value.filename == "nowhere.exr"
    assert str(raised.value).count("nowhere.exr") == 1


def test_help_tells_of_every_keyword():
    assert all(getattr(apr, name).__doc__ for name in apr.__all__ if name != "__version__")
    for name in inspect.signature(apr.denoise).parameters:
        assert re.search(rf"\b{name}\b", apr.denoise.__doc__), name


def test_types_and_licences_are_there():
    for function in (apr.read_exr, apr.inspect_exr, apr.denoise_exr):
        hints = typing.get_type_hints(function)
        assert set(inspect.signature(function).parameters) < set(hints)
    noisy, _ = picture()
    assert apr.denoise(noisy).keys() == typing.get_type_hints(apr.Result).keys()
    names = {pathlib.Path(file).name for file in importlib.metadata.files("apr-denoise")}
    assert {"LICENSE-MIT", "LICENSE-APACHE"} <= names


def test_what_is_read_is_written_and_read_again(tmp_path):
    again = tmp_path / "again.exr"
    for source, options in ((TRACED, {}), (CYCLES, {"aovs": ["auto"], "half": SECOND})):
        first = apr.read_exr(source, **options)
        apr.write_exr(again, **first)
        second = apr.read_exr(again, aovs=list(first["aovs"]))
        assert first.keys() == second.keys() and same(first["color"], second["color"])
        assert first["spp"] == second["spp"]
        for name in ("variance", "halves"):
            assert (first[name] is None) == (second[name] is None), name
        for name in ("features", "feature_variance", "aovs"):
            assert first[name].keys() == second[name].keys(), name
            assert all(same(first[name][n], second[name][n]) for n in first[name]), name
        if first["halves"]:  # the second follows from the mean and the first
            assert same(first["halves"][0], second["halves"][0])
            assert np.allclose(first["halves"][1], second["halves"][1], rtol=1e-5, atol=1e-6)


def test_planes_have_the_names_that_renderers_give_them(tmp_path):
    noisy, _ = picture()
    path = tmp_path / "a.exr"
    apr.write_exr(path, noisy, depth=noisy[..., 0], layers={"normal": noisy, "apr.mse": noisy[..., 1]})
    channels = apr.inspect_exr(path)["files"][0]["parts"][0]["channels"]
    names = {channel.split(":")[0] for channel in channels}
    assert {"depth.Z", "normal.X", "normal.Y", "normal.Z", "apr.mse.Y"} <= names
    assert {"depth", "normal"} <= apr.read_exr(path)["features"].keys()


def test_layouts_are_warned_of_at_the_callers_line(tmp_path):
    noisy, _ = picture()
    path = tmp_path / "a.exr"
    apr.write_exr(path, np.zeros_like(noisy))  # a colour that is nowhere above 0
    for call in (apr.read_exr, lambda path: apr.denoise_exr(path, tmp_path / "b.exr")):
        with pytest.warns(apr.LayoutWarning) as told:
            call(path)
        assert {pathlib.Path(warning.filename).name for warning in told} == {"test_apr.py"}
        assert [str(warning.message) for warning in told] == apr.inspect_exr(path)["warnings"]
    assert issubclass(apr.LayoutWarning, UserWarning)


def test_progress_ascends_to_1_and_costs_no_bit():
    noisy, _ = picture(160, 240)
    told = []
    result = apr.denoise(noisy, threads=1, progress=told.append)
    assert told == sorted(set(told)) and 0 <= told[0] and told[-1] == 1 and len(told) > 2
    assert same(result["color"], apr.denoise(noisy)["color"])


def test_what_progress_raises_stops_the_run_and_leaves_no_file(tmp_path):
    noisy, _ = picture(480, 640)
    render, output = tmp_path / "render.exr", tmp_path / "out.exr"
    apr.write_exr(render, noisy)

    def stop(share):
        told.append(share)
        raise Enough(share)

    for call in (lambda: apr.denoise(noisy, progress=stop),
                 lambda: apr.denoise_exr(render, output, progress=stop)):
        told = []
        with pytest.raises(Enough):
            call()
        assert len(told) == 1 and told[0] < 1
    assert list(tmp_path.iterdir()) == [render]


class Enough(Exception):
    pass


@pytest.mark.skipif(os.name == "nt", reason="no signals of this kind")
def test_ctrl_c_ends_a_run(tmp_path):
    noisy, _ = picture(960, 1280)
    render, output = tmp_path / "render.exr", tmp_path / "out.exr"
    apr.write_exr(render, noisy)
    # What a shell starts in the background ignores the signal, and so would Python.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
            apr.denoise_exr(render, output, preset="best")  # some seconds
    finally:
        signal.signal(signal.SIGINT, before)
    assert list(tmp_path.iterdir()) == [render], "it went on to the end"


def test_other_threads_run_meanwhile():
    noisy, _ = picture(120, 160)
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(1)
            done.wait(0.001)

    ticker = threading.Thread(target=tick)
    ticker.start()
    before = len(ticks)
    apr.denoise(noisy)
    during = len(ticks) - before
    done.set()
    ticker.join()
    assert during > 1, "the GIL was held"
