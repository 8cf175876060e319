"""What schemathesis cannot know from proto/openapi.yaml: the scenes that are there, and what binary bodies look like.

Half of the paths that name a scene name one of those that the run keeps, half name anything; what would end such a
scene never names it. Bodies in binary are valid ones and random bytes."""

import os
import struct
from pathlib import Path

import schemathesis
from hypothesis import strategies as st

# The scenes that the run keeps, each a GLB, and one model as glTF JSON.
FOLDER = Path(os.environ["GRIDCAST_CONTRACT_MODELS"])
KEPT = sorted(path.stem for path in FOLDER.glob("*.glb"))
FLOATS = st.floats(width=32) | st.integers(-3, 3).map(float)


def rows(code, columns):
    """Rows of so many numbers, as struct's `code`."""
    row = st.lists(FLOATS, min_size=columns, max_size=columns)
    return st.lists(row, max_size=20).map(lambda found: b"".join(struct.pack(f"<{columns}{code}", *one) for one in found))


def moves():
    """Ids, then a matrix for each, in the instances' format."""
    ids = st.lists(st.integers(0, 4), max_size=4, unique=True)
    return ids.map(lambda found: struct.pack(f"<{len(found)}I", *found)
                   + struct.pack("<12d", 1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 0) * len(found))


BODIES = {
    "application/vnd.gridcast.rays": rows("f", 6) | rows("d", 8),
    "application/vnd.gridcast.points": rows("f", 3) | rows("d", 3),
    "application/vnd.gridcast.pairs": rows("f", 6) | rows("d", 6),
    "application/vnd.gridcast.vertices": rows("f", 3),
    "application/vnd.gridcast.instances": moves(),
    "model/gltf-binary": st.sampled_from([(FOLDER / f"{name}.glb").read_bytes() for name in KEPT]),
    "model/gltf+json": st.just((FOLDER / "box.gltf").read_bytes()),
}
for media_type, strategy in BODIES.items():
    schemathesis.openapi.media_type(media_type, strategy | st.binary(max_size=200))


def fixed_choice(value, count):
    """A number below `count` that depends on the value alone, so that a failing case can be repeated."""
    return sum(str(value).encode()) % count


def ends_scenes(operation):
    return operation.method.upper() == "DELETE" and operation.path.endswith("{scene}")


@schemathesis.hook
def before_call(context, case, kwargs):
    # Names also come from answers: of the list of scenes, for one.
    if ends_scenes(case.operation) and case.path_parameters.get("scene") in KEPT:
        case.path_parameters["scene"] += "-not"


@schemathesis.hook
def map_path_parameters(context, path_parameters):
    name = (path_parameters or {}).get("scene")
    if name is None or ends_scenes(context.operation):
        return path_parameters
    choice = fixed_choice(name, 2 * len(KEPT))
    changed = {"scene": KEPT[choice]} if choice < len(KEPT) else {}
    # Small ids are there; those drawn at random hardly ever.
    for key in ("mesh", "instance"):
        if isinstance(path_parameters.get(key), int) and path_parameters[key] % 2 == 0:
            changed[key] = path_parameters[key] % 3
    return path_parameters | changed


@schemathesis.hook
def filter_query(context, query):
    # One field without a name is written as no field is: nobody can tell them apart.
    return (query or {}).get("fields") not in ("", [""])
