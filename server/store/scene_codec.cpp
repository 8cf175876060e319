#include "server/store/scene_codec.h"

#include <array>
#include <bit>
#include <cstring>
#include <optional>
#include <utility>

#include "server/store/scene_fields.h"

namespace gridcast::server::store {
namespace {

/// Before everything that is written: four letters and the format.
enum class Kind : std::uint32_t {
  kMesh = 0x48534d47,
  kData = 0x41544447,
  kSnapshot = 0x50534e47,
  kDelta = 0x544c4447
};

constexpr std::uint32_t newest_format(Kind kind) {
  return kind == Kind::kSnapshot || kind == Kind::kDelta ? kVersionFormat : kContentFormat;
}

/// Columns of a mesh's vertices after a change: all values, or those at `ids` alone.
struct ColumnDelta {
  std::uint64_t size = 0;
  std::vector<std::uint32_t> ids;
  std::vector<Vec3f> values;
};

/// Moved vertices of a mesh that otherwise stayed as it was.
struct VertexDelta {
  std::uint32_t vertex_version = 0;
  ColumnDelta positions;
  ColumnDelta normals;
};

struct MeshDelta {
  std::uint32_t mesh_id = kInvalidId;
  blas::BuildOptions build;
  std::optional<mesh::TriangleMesh> whole;
  std::optional<VertexDelta> vertices;
};

struct Delta {
  std::uint64_t version = 1;
  std::optional<scene::Pose> pose;
  std::vector<scene::InstanceChange> instances;
  std::vector<scene::InstanceName> added_names;
  std::vector<MeshDelta> meshes;
  std::map<std::uint32_t, std::string> new_names;
};

template <class A>
void fields(A& archive, Is<ColumnDelta> auto& column) {
  auto& [size, ids, values] = column;
  archive(size, ids, values);
}
template <class A>
void fields(A& archive, Is<VertexDelta> auto& vertices) {
  auto& [vertex_version, positions, normals] = vertices;
  archive(vertex_version, positions, normals);
}
template <class A>
void fields(A& archive, Is<MeshDelta> auto& mesh) {
  auto& [mesh_id, build, whole, vertices] = mesh;
  archive(mesh_id, build, whole, vertices);
}
template <class A>
void fields(A& archive, Is<Delta> auto& delta) {
  auto& [version, pose, instances, added_names, meshes, new_names] = delta;
  archive(version, pose, instances, added_names, meshes);
  if (archive.format() >= 2) archive(new_names);
}

template <class T>
std::string encode_as(Kind kind, const T& value) {
  const std::uint32_t format = newest_format(kind);
  ByteWriter writer(format);
  writer(std::uint32_t(kind), format, value);
  return writer.take();
}

template <class T>
Result<T> decode_as(Kind kind, std::string_view bytes) {
  T value;
  std::uint32_t kind_read = 0;
  std::uint32_t format = 0;
  ByteReader reader(bytes);
  reader(kind_read, format);
  if (kind_read != std::uint32_t(kind)) return Error{ErrorCode::kInvalidFile, "it holds something else", ""};
  if (format < 1 || format > newest_format(kind))
    return Error{ErrorCode::kUnsupported, "it was written in format " + std::to_string(format), ""};
  reader.set_format(format);
  reader(value);
  if (!reader.ok()) return Error{ErrorCode::kInvalidFile, "it breaks its format", ""};
  return value;
}

template <class T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

/// Bits are compared, not values: -0 is not 0 here.
ColumnDelta column_delta(const std::vector<Vec3f>& before, const std::vector<Vec3f>& after) {
  using Bits = std::array<std::uint32_t, 3>;
  ColumnDelta delta{after.size(), {}, {}};
  if (before.size() == after.size()) {
    for (std::size_t i = 0; i < after.size(); ++i) {
      if (std::bit_cast<Bits>(before[i]) == std::bit_cast<Bits>(after[i])) continue;
      delta.ids.push_back(std::uint32_t(i));
      delta.values.push_back(after[i]);
    }
    if (delta.ids.size() * (sizeof(Vec3f) + sizeof(std::uint32_t)) < after.size() * sizeof(Vec3f))
      return delta;
  }
  return {after.size(), {}, after};
}

bool apply_column(const ColumnDelta& delta, std::vector<Vec3f>& column) {
  if (delta.ids.empty() && delta.values.size() == delta.size) {
    // Nothing changed in an empty column, or everything in another.
    column = delta.values;
    return true;
  }
  if (delta.size != column.size() || delta.ids.size() != delta.values.size()) return false;
  for (std::size_t i = 0; i < delta.ids.size(); ++i) {
    if (delta.ids[i] >= column.size()) return false;
    column[delta.ids[i]] = delta.values[i];
  }
  return true;
}

bool only_vertices_differ(const mesh::TriangleMesh& a, const mesh::TriangleMesh& b) {
  return a.topology_version == b.topology_version && a.name == b.name && a.triangles == b.triangles &&
         same_bytes(a.parts, b.parts);
}

MeshDelta mesh_delta(const scene::MeshChange& change) {
  const mesh::TriangleMesh& after = *change.after.mesh;
  MeshDelta delta{change.mesh_id, change.after.build, std::nullopt, std::nullopt};
  if (change.before == nullptr || !only_vertices_differ(*change.before, after)) {
    delta.whole = after;
  } else {
    delta.vertices =
        VertexDelta{after.vertex_version, column_delta(change.before->positions, after.positions),
                    column_delta(change.before->normals, after.normals)};
  }
  return delta;
}

Error not_of_this_state() {
  return {ErrorCode::kInvalidFile, "the update does not follow the version before it", ""};
}

Status apply_instances(const Delta& delta, scene::SceneState& state) {
  for (const scene::InstanceChange& change : delta.instances) {
    if (change.instance_id > state.instances.size()) return not_of_this_state();
    if (change.instance_id == state.instances.size()) state.instances.emplace_back();
    state.instances[change.instance_id] = change.state;
  }
  state.added_names.insert(state.added_names.end(), delta.added_names.begin(), delta.added_names.end());
  for (const auto& [id, name] : delta.new_names) state.new_names[id] = name;
  return ok_status();
}

}  // namespace

std::string encode(const mesh::TriangleMesh& mesh) {
  return encode_as(Kind::kMesh, mesh);
}
Result<mesh::TriangleMesh> decode_mesh(std::string_view bytes) {
  return decode_as<mesh::TriangleMesh>(Kind::kMesh, bytes);
}

std::string encode(const scene::SceneData& data) {
  return encode_as(Kind::kData, data);
}
Result<scene::SceneData> decode_data(std::string_view bytes) {
  return decode_as<scene::SceneData>(Kind::kData, bytes);
}

std::string encode(const Snapshot& snapshot) {
  return encode_as(Kind::kSnapshot, snapshot);
}
Result<Snapshot> decode_snapshot(std::string_view bytes) {
  return decode_as<Snapshot>(Kind::kSnapshot, bytes);
}

std::string encode(const scene::SceneDelta& delta) {
  Delta written{delta.version, delta.pose, delta.instances, delta.added_names, {}, delta.new_names};
  for (const scene::MeshChange& change : delta.meshes) written.meshes.push_back(mesh_delta(change));
  return encode_as(Kind::kDelta, written);
}

Status DeltaReplay::apply(std::string_view bytes) {
  auto decoded = decode_as<Delta>(Kind::kDelta, bytes);
  if (!decoded) return decoded.error();
  Delta& delta = decoded.value();
  if (delta.version != state_.version + 1) return not_of_this_state();
  for (MeshDelta& change : delta.meshes) {
    if (change.mesh_id > state_.meshes.size()) return not_of_this_state();
    if (change.mesh_id == state_.meshes.size()) state_.meshes.emplace_back();
    scene::MeshState& mesh = state_.meshes[change.mesh_id];
    own_.resize(state_.meshes.size());
    auto& own = own_[change.mesh_id];
    if (change.whole) {
      own = std::make_shared<mesh::TriangleMesh>(*std::move(change.whole));
    } else {
      if (!change.vertices || mesh.mesh == nullptr) return not_of_this_state();
      if (own == nullptr) own = std::make_shared<mesh::TriangleMesh>(*mesh.mesh);
      own->vertex_version = change.vertices->vertex_version;
      if (!apply_column(change.vertices->positions, own->positions) ||
          !apply_column(change.vertices->normals, own->normals))
        return not_of_this_state();
    }
    mesh = {own, change.build};
  }
  if (Status status = apply_instances(delta, state_); !status) return status;
  if (delta.pose) {
    if (delta.pose->nodes == nullptr && state_.pose != nullptr) delta.pose->nodes = state_.pose->nodes;
    state_.pose = std::make_shared<const scene::Pose>(*std::move(delta.pose));
  }
  state_.version = delta.version;
  return ok_status();
}

}  // namespace gridcast::server::store
