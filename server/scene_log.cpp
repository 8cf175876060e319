#include "server/scene_log.h"

#include <algorithm>
#include <utility>

namespace gridcast::server {
namespace {

template <class T>
std::size_t held(const std::vector<T>& list) {
  return list.capacity() * sizeof(T);
}

/// What an edit holds beyond itself.
struct BytesHeld {
  std::size_t operator()(const scene::AddInstance& edit) const { return edit.name.capacity(); }
  std::size_t operator()(const scene::RemoveInstance& /*edit*/) const { return 0; }
  std::size_t operator()(const scene::MoveInstance& /*edit*/) const { return 0; }
  std::size_t operator()(const scene::ChangeInstance& edit) const {
    return edit.name ? edit.name->capacity() : 0;
  }
  std::size_t operator()(const scene::MoveInstances& edit) const { return held(edit.moves); }
  std::size_t operator()(const scene::ReplaceVertices& edit) const {
    return held(edit.positions) + held(edit.vertex_ids);
  }
  std::size_t operator()(const scene::AddMesh& /*edit*/) const { return 0; }
  std::size_t operator()(const scene::SetPose& edit) const {
    std::size_t bytes = held(edit.nodes) + held(edit.skins) + held(edit.weights);
    for (const scene::SkinJoints& skin : edit.skins) bytes += held(skin.joint_matrices);
    for (const scene::MorphWeights& mesh : edit.weights) bytes += held(mesh.weights);
    return bytes;
  }
};

bool is_writable(const scene::SceneEdit& edit) {
  return !std::holds_alternative<scene::AddMesh>(edit);
}

}  // namespace

std::size_t memory_bytes(const std::vector<scene::SceneEdit>& edits) {
  std::size_t bytes = sizeof(std::vector<scene::SceneEdit>) + held(edits);
  for (const scene::SceneEdit& edit : edits) bytes += std::visit(BytesHeld{}, edit);
  return bytes;
}

std::deque<LogLine> SceneLog::add(LogLine line) {
  const bool ends_log = !std::ranges::all_of(*line.edits, is_writable);
  bytes_ += line.bytes;
  lines_.push_back(std::move(line));
  if (ends_log) return clear();
  std::deque<LogLine> dropped;
  while (bytes_ > max_bytes_) {
    since_ = lines_.front().version;
    bytes_ -= lines_.front().bytes;
    dropped.push_back(std::move(lines_.front()));
    lines_.pop_front();
  }
  return dropped;
}

std::vector<LogLine> SceneLog::after(std::uint64_t version, std::size_t limit) const {
  const auto begin = lines_.begin() + std::ptrdiff_t(version - since_);
  return {begin, begin + std::ptrdiff_t(std::min(limit, std::size_t(lines_.end() - begin)))};
}

std::deque<LogLine> SceneLog::clear() {
  if (!lines_.empty()) since_ = lines_.back().version;
  bytes_ = 0;
  return std::exchange(lines_, {});
}

}  // namespace gridcast::server
