"""The arrows of the architecture, as tables. check_layering.py reads the code against them.

Paths are relative to the repository. A place is a folder (ends with "/") or a file; the longest place that a
file lies in decides for it.
"""

# The parts of the server that lie beside its folders.
SERVER_PARTS = ["server/describe.h", "server/jobs.h", "server/load.h", "server/log.h", "server/machine.h",
                "server/memory_budget.h", "server/metrics.h", "server/picture.h", "server/scene_log.h",
                "server/scene_store.h", "server/signals.h", "server/thread_limit.h", "server/tree_builder.h",
                "server/work_gate.h"]

# What the files of a place may include of ours. A folder may always include its own headers.
ARROWS = {
    "core/error.h": [],
    "core/math/": ["core/error.h"],
    "core/mesh/": ["core/error.h", "core/math/"],
    "core/blas/": ["core/error.h", "core/math/", "core/mesh/"],
    "core/tlas/": ["core/error.h", "core/math/"],
    "core/scene/": ["core/error.h", "core/math/", "core/mesh/", "core/blas/", "core/tlas/"],
    "core/render/": ["core/error.h", "core/math/", "core/mesh/", "core/blas/", "core/tlas/", "core/scene/"],
    # A sensor knows rays and cameras, and no scene: what traces its rays stands above both.
    "core/sensor/": ["core/error.h", "core/math/", "core/render/camera.h"],
    # A picture file is written from a film; io knows nothing else of render.
    "core/io/": ["core/error.h", "core/math/", "core/mesh/", "core/scene/", "core/render/film.h"],
    "core/measure/": ["core/"],
    # The reference shares no code with what it judges: plain values come in, nothing else.
    "core/measure/exact/": ["core/error.h", "core/math/vec.h", "core/math/ray.h", "core/math/affine.h"],
    # The contract with clients knows values, never a structure or the scene.
    "proto/": ["core/error.h", "core/math/"],
    "server/": ["core/", "proto/"],
    # What outlasts the process: knows the engine and the log, no request.
    "server/store/": ["core/", "server/log.h"],
    # Who may do what: knows requests as values, no socket and no scene.
    "server/access/": ["core/error.h", "proto/", "server/http/http_types.h", "server/store/sha256.h"],
    # The edge: sockets, heads, bodies, queues. Hands requests to a router and knows no scene.
    "server/http/": ["core/error.h", "proto/", "server/access/", "server/log.h", "server/memory_budget.h",
                     "server/work_gate.h"],
    # The process that parses models: knows what a scene is made of, no request.
    "server/import/": ["core/", "proto/", "server/child_process.h", "server/log.h", "server/store/bytes.h",
                       "server/store/scene_codec.h"],
    # What a request means: knows the engine and the edge's values, never a command of the program or a benchmark.
    "server/routes/": ["core/", "proto/", "server/access/", "server/chart/", "server/http/", "server/import/", *SERVER_PARTS,
                       "server/store/sha256.h"],
    # Pictures of figures.
    "server/chart/": ["core/", "proto/", "server/child_process.h", "server/machine.h", "server/number_text.h"],
    # Servers under load, in the process itself.
    "server/bench/": ["core/", "proto/", "server/http/", "server/routes/api.h", *SERVER_PARTS],
    # The commands of the program: above everything else.
    "server/cli/": ["core/", "proto/", "server/"],
    "tests/support/": ["core/", "proto/"],
    "tests/": ["core/", "proto/", "server/", "tests/"],
}

# Tasks: builds and queries share one pool; the server only sets how many threads it has.
TBB_USERS = ["core/mesh/", "core/blas/", "core/tlas/", "core/scene/", "core/render/", "core/io/", "core/measure/",
             "server/thread_limit.cpp", "server/tree_builder.cpp", "tests/"]

# Where a third-party header may be included: first matching prefix of the name between < and >.
THIRD_PARTY = {
    "glm/": ["core/math/", "tests/"],
    "OpenMesh/": ["core/mesh/"],
    "embree3/": ["core/blas/embree_tree.cpp", "core/measure/embree_yardstick.cpp"],
    "embree4/": ["core/blas/embree_tree.cpp", "core/measure/embree_yardstick.cpp"],
    "tbb/": TBB_USERS,
    "oneapi/tbb/": TBB_USERS,
    "hwy/": ["core/math/", "core/blas/", "core/tlas/", "core/scene/geometric_normal.cpp", "core/scene/hull_lanes-inl.h", "core/scene/place_batch.cpp"],
    "tiny_gltf.h": ["core/io/"],
    "draco/": ["core/io/", "tests/unit/io/"],
    "meshoptimizer.h": ["core/io/", "tests/unit/io/"],
    "OpenEXR/": ["core/io/", "tests/unit/io/"],
    "Imath/": ["core/io/", "tests/unit/io/"],
    "Imf": ["core/io/", "tests/unit/io/"],
    "png.h": ["core/io/", "tests/unit/io/"],
    "simdjson.h": ["core/io/", "proto/"],
    "nlohmann/": ["core/io/", "proto/", "server/", "tests/"],
    "httplib.h": ["server/"],
    "CLI/": ["server/"],
    "spdlog/": ["server/"],
    "fmt/": ["server/"],
    "prometheus/": ["server/"],
    "sqlite3.h": ["server/store/"],
    "zstd": ["proto/zstd.cpp"],
    "openssl/": ["server/store/sha256.cpp", "server/access/access_control.cpp"],
    "gtest/": ["tests/"],
    "gmock/": ["tests/"],
    "rapidcheck": ["tests/"],
    "benchmark/": ["tests/"],
    "boost/multiprecision/": ["core/measure/exact/"],
    # LGPL, for the second opinion in tests: nothing that ships may link it.
    "gmp": ["tests/support/"],
}

# Libraries that few files may include, wherever they are: {prefix: how many}. Embree is a tree of core/blas
# and the yardstick of core/measure; the HTTP library is the edge of the server and the yardstick beside it.
FEW_FILES_ONLY = {"httplib.h": 2, "embree3/": 2, "sqlite3.h": 1, "zstd.h": 1}

# System headers (POSIX): who talks to the operating system.
SYSTEM = {
    "fcntl.h": ["core/io/", "server/", "tests/"],
    "unistd.h": ["core/io/", "server/", "tests/"],
    "sys/stat.h": ["core/io/", "server/", "tests/"],
    # Huge pages.
    "sys/mman.h": ["core/math/uninitialized_allocator.cpp", "server/", "tests/"],
    "sys/": ["server/", "tests/"],
    "netinet/": ["server/", "tests/"],
    "arpa/": ["server/", "tests/"],
    "malloc.h": ["server/"],
    # Where a library lies, to look into its file.
    "dlfcn.h": ["core/measure/embree_yardstick.cpp", "tests/durability/"],
    "sched.h": ["server/bench/cores_apart.cpp"],
    "poll.h": ["server/", "tests/"],
    "signal.h": ["server/", "tests/"],
    # Programs that ours starts.
    "spawn.h": ["server/child_process.cpp"],
    # What the process that parses models gives up.
    "linux/": ["server/import/import_child.cpp"],
    "immintrin.h": ["core/blas/", "core/tlas/"],
    # The control register of floating point, to flush denormals on purpose.
    "xmmintrin.h": ["tests/stability/"],
}

# core never prints: the streams of the standard library stay outside of it.
STANDARD = {"iostream": ["server/", "tests/"]}

MAX_LINES = 400
