#include "server/scene_store.h"

#include <algorithm>
#include <cctype>
#include <optional>
#include <utility>

#include "proto/etag.h"

namespace gridcast::server {

using proto::Problem;
using proto::ProblemCode;

std::shared_ptr<const scene::Scene> NamedScene::snapshot() const {
  const std::lock_guard lock(pointer_);
  return current_;
}

std::variant<scene::UpdateResult, Problem, Error> NamedScene::update(
    std::string_view if_match, const std::vector<scene::SceneEdit>& edits, const std::stop_token& stop) {
  const auto turn = writing_.enter(stop);
  if (!turn) return Error{ErrorCode::kCancelled, "stopped before its turn came", ""};
  const std::shared_ptr<const scene::Scene> before = snapshot();
  if (auto problem = check_if_match(if_match, before->version())) return std::move(*problem);
  Result<scene::UpdateResult> updated = apply_update(*before, edits);
  if (!updated) return updated.error();
  const std::lock_guard lock(pointer_);
  current_ = updated->scene;
  std::erase_if(versions_, [](const auto& version) { return version.expired(); });
  versions_.emplace_back(current_);
  return std::move(updated).value();
}

std::size_t NamedScene::live_versions() const {
  const std::lock_guard lock(pointer_);
  return std::size_t(std::count_if(versions_.begin(), versions_.end(),
                                   [](const auto& version) { return !version.expired(); }));
}

std::optional<Problem> check_if_match(std::string_view if_match, std::uint64_t version) {
  if (if_match.empty()) return std::nullopt;
  switch (proto::match_etag(if_match, version, proto::TagComparison::kStrong)) {
    case proto::TagMatch::kMatches:
      return std::nullopt;
    case proto::TagMatch::kMalformed:
      return Problem{ProblemCode::kInvalidHeader, "If-Match must be * or a list of quoted versions",
                     "If-Match"};
    case proto::TagMatch::kDiffers:
      break;
  }
  return Problem{ProblemCode::kVersionMismatch, "the scene is at version " + std::to_string(version),
                 "If-Match"};
}

bool SceneStore::is_valid_id(std::string_view id) {
  return !id.empty() && id.size() <= 64 && id != "." && id != ".." &&
         std::all_of(id.begin(), id.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '-';
         });
}

std::optional<Problem> SceneStore::check_new(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  if (scenes_.size() >= max_scenes_)
    return Problem{ProblemCode::kTooManyScenes,
                   "there are " + std::to_string(max_scenes_) + " scenes already", ""};
  if (!id.empty() && scenes_.find(id) != scenes_.end())
    return Problem{ProblemCode::kNameTaken, "a scene of this name exists", "?name"};
  return std::nullopt;
}

std::variant<std::shared_ptr<NamedScene>, Problem> SceneStore::create(
    std::string id, std::shared_ptr<const scene::Scene> first, SceneOrigin origin) {
  if (auto problem = check_new(id)) return std::move(*problem);
  const std::lock_guard lock(mutex_);
  while (id.empty()) {
    std::string next = std::string("s").append(std::to_string(next_id_++));
    if (scenes_.find(next) == scenes_.end()) id = std::move(next);
  }
  auto scene = std::make_shared<NamedScene>(id, std::move(first), std::move(origin));
  // Another request may have taken the name since check_new.
  if (!scenes_.emplace(id, scene).second)
    return Problem{ProblemCode::kNameTaken, "a scene of this name exists", "?name"};
  return scene;
}

std::shared_ptr<NamedScene> SceneStore::find(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  const auto found = scenes_.find(id);
  return found == scenes_.end() ? nullptr : found->second;
}

std::vector<std::shared_ptr<NamedScene>> SceneStore::list() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<NamedScene>> scenes;
  scenes.reserve(scenes_.size());
  for (const auto& [id, scene] : scenes_) scenes.push_back(scene);
  return scenes;
}

std::optional<Problem> SceneStore::erase(std::string_view id, std::string_view if_match) {
  const std::shared_ptr<NamedScene> scene = find(id);
  if (!scene) return Problem{ProblemCode::kSceneNotFound, "there is no scene of this name", ""};
  // No version appears between the check and the removal.
  const auto turn = scene->writing_.enter({});
  if (auto problem = check_if_match(if_match, scene->snapshot()->version())) return problem;
  const std::lock_guard lock(mutex_);
  const auto found = scenes_.find(id);
  if (found == scenes_.end() || found->second != scene)
    return Problem{ProblemCode::kSceneNotFound, "there is no scene of this name", ""};
  scenes_.erase(found);
  return std::nullopt;
}

}  // namespace gridcast::server
