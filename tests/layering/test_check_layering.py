"""The layering checker must fail on every kind of violation it claims to find, and on nothing else."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
CHECKER = HERE / "check_layering.py"

CLEAN = {
    "core/error.h": "#pragma once\n#include <string>\n",
    "core/math/vec.h": "#pragma once\n#include <glm/vec3.hpp>\n",
    "core/mesh/mesh.h": '#pragma once\n#include "core/math/vec.h"\n',
    "core/blas/blas.h": '#pragma once\n#include "core/mesh/mesh.h"\n',
    "core/tlas/grid.h": '#pragma once\n#include "core/math/vec.h"\n',
    "core/scene/scene.h": '#pragma once\n#include "core/blas/blas.h"\n#include "core/tlas/grid.h"\n',
    "core/render/film.h": "#pragma once\n#include <vector>\n",
    "core/render/render.h": '#pragma once\n#include "core/scene/scene.h"\n',
    "core/io/image.h": '#pragma once\n#include "core/render/film.h"\n',
    "proto/codec.h": '#pragma once\n#include "core/error.h"\n#include "core/math/vec.h"\n',
    "server/routes.cpp": '#include "core/scene/scene.h"\n#include "proto/codec.h"\n#include <iostream>\n',
    "server/http.cpp": "#include <httplib.h>\n",
    "server/yardstick.cpp": "#include <httplib.h>\n",
    "tests/unit/scene_test.cpp": '#include <gtest/gtest.h>\n#include "core/scene/scene.h"\n',
}

VIOLATIONS = {
    "math_knows_mesh": ("core/math/a.h", '#pragma once\n#include "core/mesh/mesh.h"\n', "core/math/ may not"),
    "error_knows_math": ("core/error.h", '#pragma once\n#include "core/math/vec.h"\n', "core/error.h may not"),
    "mesh_knows_blas": ("core/mesh/a.cpp", '#include "core/blas/blas.h"\n', "core/mesh/ may not"),
    "tlas_knows_mesh": ("core/tlas/a.cpp", '#include "core/mesh/mesh.h"\n', "core/tlas/ may not"),
    "tlas_knows_blas": ("core/tlas/a.cpp", '#include "core/blas/blas.h"\n', "core/tlas/ may not"),
    "blas_knows_scene": ("core/blas/a.cpp", '#include "core/scene/scene.h"\n', "core/blas/ may not"),
    "scene_knows_render": ("core/scene/a.cpp", '#include "core/render/render.h"\n', "core/scene/ may not"),
    "io_knows_the_renderer": ("core/io/a.cpp", '#include "core/render/render.h"\n', "core/io/ may not"),
    "core_knows_proto": ("core/scene/a.cpp", '#include "proto/codec.h"\n', "core/scene/ may not"),
    "core_knows_server": ("core/io/a.cpp", '#include "server/routes.h"\n', "not a path from"),
    "proto_knows_the_scene": ("proto/a.cpp", '#include "core/scene/scene.h"\n', "proto/ may not"),
    "proto_knows_a_structure": ("proto/a.cpp", '#include "core/blas/blas.h"\n', "proto/ may not"),
    "support_knows_the_server": ("tests/support/a.cpp", '#include "server/routes.cpp"\n', "tests/support/ may"),
    "a_relative_include": ("core/math/a.cpp", '#include "vec.h"\n', "not a path from the repository root"),
    "a_missing_header": ("server/a.cpp", '#include "core/none.h"\n', "not a path from the repository root"),
    "a_new_core_folder": ("core/misc/a.cpp", '#include "core/error.h"\n', "no arrow is drawn"),
    "embree_outside_its_file": ("core/blas/bvh.cpp", "#include <embree3/rtcore.h>\n", "third-party"),
    "openmesh_in_scene": ("core/scene/a.cpp", "#include <OpenMesh/Core/IO/MeshIO.hh>\n", "third-party"),
    "tinygltf_in_server": ("server/a.cpp", "#include <tiny_gltf.h>\n", "third-party"),
    "httplib_in_proto": ("proto/a.cpp", "#include <httplib.h>\n", "third-party"),
    "httplib_in_three_files": ("server/third.cpp", "#include <httplib.h>\n", "for few files alone"),
    "json_in_the_scene": ("core/scene/a.cpp", "#include <nlohmann/json.hpp>\n", "third-party"),
    "gtest_in_core": ("core/math/a.cpp", "#include <gtest/gtest.h>\n", "third-party"),
    "an_unknown_library": ("server/a.cpp", "#include <curl/curl.h>\n", "in no table"),
    "sockets_in_proto": ("proto/a.cpp", "#include <sys/socket.h>\n", "system"),
    "printing_in_core": ("core/io/a.cpp", "#include <iostream>\n", "<iostream> is not for"),
    "a_computed_include": ("core/math/a.cpp", "#include HEADER\n", "computed"),
    "an_include_with_spaces": ("core/math/a.cpp", '  #  include   "core/mesh/mesh.h"\n', "core/math/ may not"),
    "no_pragma_once": ("core/math/a.h", "#include <vector>\n", "without #pragma once"),
    "no_toggling_guard": ("core/blas/a-inl.h", "#pragma once\n", "without HWY_TARGET_TOGGLE"),
    "a_file_too_long": ("core/math/a.cpp", "int x;\n" * 401, "at most 400"),
    "a_script_too_long": ("tests/api/a.py", "x = 1\n" * 401, "at most 400"),
    "a_ring_of_headers": ("core/math/vec.h", '#pragma once\n#include "core/math/vec.h"\n', "ring of headers"),
}


def plant(root, files):
    for path, text in files.items():
        target = root / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text)


def run_checker(root, *more):
    return subprocess.run([sys.executable, str(CHECKER), "--root", str(root), *more], capture_output=True, text=True,
                          check=False)


def test_a_clean_tree_passes(tmp_path):
    plant(tmp_path, CLEAN)
    done = run_checker(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip().endswith(f"{len(CLEAN)} sources, 0 violations")


@pytest.mark.parametrize("name", VIOLATIONS)
def test_a_planted_violation_is_found(tmp_path, name):
    path, text, message = VIOLATIONS[name]
    plant(tmp_path, CLEAN)
    plant(tmp_path, {path: text})
    done = run_checker(tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    problems = done.stdout.splitlines()[:-1]
    assert any(message in problem for problem in problems), problems
    assert all(path in problem for problem in problems), "nothing but the planted file is blamed"


def test_headers_that_do_not_compile_alone_are_found(tmp_path):
    plant(tmp_path, {
        "core/math/good.h": "#pragma once\n#include <string>\ninline std::string name() { return {}; }\n",
        "core/math/bad.h": "#pragma once\ninline std::string name() { return {}; }\n",
        "core/math/a.cpp": '#include "core/math/good.h"\n',
    })
    source = tmp_path / "core/math/a.cpp"
    command = f"/usr/bin/ccache /usr/bin/c++ -I{tmp_path} -std=c++20 -Werror -O3 -o a.o -c {source}"
    entry = {"directory": str(tmp_path), "command": command, "file": str(source)}
    (tmp_path / "compile_commands.json").write_text(json.dumps([entry]))
    done = run_checker(tmp_path, "--headers", str(tmp_path))
    assert done.returncode == 1
    assert "core/math/bad.h:1: does not compile alone" in done.stdout
    assert "good.h" not in done.stdout
    assert "2 headers compiled alone, 1 violations" in done.stdout
