#include "server/routes/edit_lines.h"

#include "proto/vocabulary.h"
#include "server/routes/pose_edit.h"

namespace gridcast::server {
namespace {

struct ToWire {
  proto::LogWriter& to;

  void operator()(const scene::AddInstance& edit) const {
    to.add(proto::AddInstanceRequest{edit.mesh_id, edit.world_from_object, edit.name, edit.mask});
  }
  void operator()(const scene::RemoveInstance& edit) const {
    to.add(proto::RemoveInstanceRequest{edit.instance_id});
  }
  void operator()(const scene::MoveInstance& edit) const {
    to.add(proto::InstanceMove{edit.instance_id, edit.world_from_object});
  }
  void operator()(const scene::ChangeInstance& edit) const {
    // A move and nothing else has a shorter name.
    if (edit.world_from_object && !edit.mask && !edit.name)
      return (*this)(scene::MoveInstance{edit.instance_id, *edit.world_from_object});
    to.add(proto::InstanceChange{edit.instance_id, {edit.world_from_object, edit.mask, edit.name}});
  }
  void operator()(const scene::MoveInstances& edit) const {
    for (const scene::MoveInstance& move : edit.moves) (*this)(move);
  }
  void operator()(const scene::ReplaceVertices& edit) const {
    to.add(proto::MeshVerticesRequest{edit.mesh_id,
                                      {edit.positions, edit.vertex_ids, std::string(to_string(edit.mode))}});
  }
  /// Never in a log: see SceneLog::add.
  void operator()(const scene::AddMesh& /*edit*/) const {}
  void operator()(const scene::SetPose& edit) const {
    to.add(proto::PoseEditRequest{std::string(proto::kEditNames[4]), pose_request(edit)});
  }
};

}  // namespace

void write_line(const LogLine& line, proto::LogWriter& to) {
  to.begin(line.version);
  for (const scene::SceneEdit& edit : *line.edits) std::visit(ToWire{to}, edit);
  to.end();
}

}  // namespace gridcast::server
