# SPDX-License-Identifier: Apache-2.0
"""Other people's projects find the C core and the C++ twin, and get what the robot and twin do."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


def run(*command, **kwargs):
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, check=False, **kwargs
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def configure(source, build, *options):
    run("cmake", "-G", "Ninja", "-S", source, "-B", build, *options)


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """The tree that `cmake --install` makes, moved to another place."""
    made = tmp_path_factory.mktemp("install")
    run("cmake", "--install", os.environ["TWINMILL_BUILD"], "--prefix", made / "here")
    return (made / "here").rename(made / "moved")


def frame(folder, u, v):
    """A 640x480 picture of one colour: Y of 120 and these U and V."""
    path = folder / f"{u}_{v}.yuyv"
    path.write_bytes(bytes([120, u, 120, v]) * (640 * 480 // 2))
    return path


def check_decide(decide, folder):
    # Milling (Vega et al. 2024): full speed, half a turn input to the right, with a neighbour in
    # sight to the left. The vendor's mixing, 126 duties a turn input, clamped: 100 -+ 63.
    grey, green = (run(decide, frame(folder, *uv)) for uv in [(128, 128), (60, 60)])
    assert grey == "blob 0 px, bit 0, duties 100 37 100 37 %\n"
    assert green == "blob 307200 px, bit 1, duties 37 100 37 100 %\n"


def test_a_c_project_finds_the_core_with_cmake(prefix, tmp_path):
    configure(EXAMPLES / "core_c", tmp_path / "b", f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", tmp_path / "b")
    check_decide(tmp_path / "b/decide", tmp_path)


def test_a_c_program_finds_the_core_with_pkg_config(prefix, tmp_path):
    (pc,) = prefix.rglob("twinmill-core.pc")
    flags = run(
        "pkg-config",
        "--cflags",
        "--libs",
        "twinmill-core",
        env=os.environ | {"PKG_CONFIG_PATH": str(pc.parent)},
    ).split()
    source, *options = EXAMPLES / "core_c/decide.c", "-std=c11", "-pedantic", "-Wall", "-Werror"
    run("cc", *options, source, *flags, "-o", tmp_path / "decide")
    check_decide(tmp_path / "decide", tmp_path)


def test_a_cpp_project_finds_the_twin_and_its_robots_mill(prefix, tmp_path):
    configure(EXAMPLES / "twin_cpp", tmp_path / "b", f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", tmp_path / "b")
    (model,) = prefix.rglob("paper.toml")
    printed = run(tmp_path / "b/mill", model)
    circliness, kind = re.fullmatch(r"circliness (\S+), radius \S+ m: (\w+)\n", printed).groups()
    # Milling is what the paper calls a ring of circliness near 0.
    assert kind == "milling"
    assert 0 < float(circliness) < 0.2


def test_a_project_builds_the_core_as_a_subdirectory(tmp_path):
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\n"
        "project(other LANGUAGES C CXX)\n"
        f"add_subdirectory({ROOT} twinmill EXCLUDE_FROM_ALL)\n"
        f"add_executable(decide {EXAMPLES}/core_c/decide.c)\n"
        "target_link_libraries(decide PRIVATE twinmill::core)\n"
        # Configured alone: building it would build the twin a second time.
        f"add_executable(mill EXCLUDE_FROM_ALL {EXAMPLES}/twin_cpp/mill.cpp)\n"
        "target_link_libraries(mill PRIVATE twinmill::twin)\n"
    )
    configure(tmp_path, tmp_path / "b")
    run("cmake", "--build", tmp_path / "b", "--target", "decide")
    check_decide(tmp_path / "b/decide", tmp_path)


def test_the_mujoco_plant_is_found_where_mujoco_is(prefix, tmp_path):
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\n"
        "project(other LANGUAGES CXX)\n"
        "find_package(twinmill REQUIRED COMPONENTS mujoco)\n"
        "add_executable(robots main.cpp)\n"
        "target_link_libraries(robots PRIVATE twinmill::mujoco)\n"
    )
    (tmp_path / "main.cpp").write_text(
        '#include "plant_mujoco/mujoco_plant.h"\n'
        "int main(int argc, char **argv) {\n"
        '  const auto robots = std::vector{twin::Model::Load("turbopi.toml")};\n'
        "  return twin::MujocoPlant(argv[argc - 1], robots, {{}}, {}).Size() - 1; }\n"
    )
    configure(
        tmp_path,
        tmp_path / "b",
        f"-DCMAKE_PREFIX_PATH={prefix}",
        f"-DPython_EXECUTABLE={sys.executable}",
    )
    run("cmake", "--build", tmp_path / "b")
    (mjcf,) = prefix.rglob("turbopi.xml")
    models = {"TWINMILL_MODELS": str(prefix / "share/twinmill/models")}
    run(tmp_path / "b/robots", mjcf, env=os.environ | models)


def test_a_component_that_is_not_there_is_named(prefix, tmp_path):
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\n"
        "project(other LANGUAGES C)\n"
        "find_package(twinmill REQUIRED COMPONENTS wings)\n"
    )
    done = subprocess.run(
        ["cmake", "-S", tmp_path, "-B", tmp_path / "b", f"-DCMAKE_PREFIX_PATH={prefix}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "wings" in done.stderr


def test_nothing_is_installed_beside_headers_libraries_and_models(prefix):
    assert {path.name for path in prefix.iterdir()} == {"include", "lib", "share"}
    assert {path.name for path in (prefix / "include").iterdir()} == {"twinmill"}
