#include "server/scene_store.h"

#include <algorithm>
#include <cctype>
#include <optional>
#include <utility>

#include "proto/etag.h"
#include "server/tree_builder.h"

namespace gridcast::server {

using proto::Problem;
using proto::ProblemCode;

namespace {

Problem no_scene() {
  return {ProblemCode::kSceneNotFound, "there is no scene of this name", ""};
}

Problem no_version(std::uint64_t newest) {
  return {ProblemCode::kVersionNotFound, "the scene is at version " + std::to_string(newest), ""};
}

/// The operator's log says why.
Problem not_stored(const Error& error) {
  if (error.code == ErrorCode::kNotFound) return no_scene();
  if (error.code == ErrorCode::kLimitExceeded)
    return {ProblemCode::kStorageFull, "the server's disk is full; nothing was changed", ""};
  return {ProblemCode::kStorageFailed, "the server's disk failed; nothing was changed", ""};
}

}  // namespace

std::shared_ptr<const scene::Scene> NamedScene::snapshot() const {
  const std::lock_guard lock(pointer_);
  return kept_.back();
}

std::variant<std::shared_ptr<const scene::Scene>, Problem> NamedScene::snapshot_at(
    std::uint64_t version) const {
  const std::lock_guard lock(pointer_);
  const std::uint64_t oldest = kept_.front()->version(), newest = kept_.back()->version();
  if (version > newest) return no_version(newest);
  if (version < oldest)
    return Problem{ProblemCode::kVersionGone,
                   "versions " + std::to_string(oldest) + " to " + std::to_string(newest) + " are kept", ""};
  return kept_[version - oldest];
}

std::variant<scene::UpdateResult, Problem, Error> NamedScene::update(std::string_view if_match,
                                                                     const SharedEdits& edits,
                                                                     const std::stop_token& stop) {
  const auto turn = writing_.enter(stop);
  if (!turn) return Error{ErrorCode::kCancelled, "stopped before its turn came", ""};
  if (erased_) return no_scene();
  const std::shared_ptr<const scene::Scene> before = snapshot();
  if (auto problem = check_if_match(if_match, before->version())) return std::move(*problem);
  const auto place = trees_ != nullptr ? scene::RebuildPlace::kInBackground : scene::RebuildPlace::kInUpdate;
  Result<scene::UpdateResult> updated = apply_update(*before, *edits, {place});
  if (!updated) return updated.error();
  if (stored_.archive != nullptr) {
    const Status stored = stored_.archive->append(stored_.key, *before, updated->scene);
    if (!stored) return not_stored(stored.error());
  }
  publish(updated->scene, edits);
  if (trees_ != nullptr)
    for (const std::uint32_t mesh_id : scene::wanted_trees(updated->report))
      trees_->want(shared_from_this(), mesh_id);
  return std::move(updated).value();
}

void NamedScene::publish(std::shared_ptr<const scene::Scene> scene, const SharedEdits& edits) {
  std::optional<LogLine> line;
  if (edits != nullptr) line.emplace(scene->version(), edits);
  std::shared_ptr<const scene::Scene> old;  // what goes, goes after the lock
  std::deque<LogLine> old_lines;
  const std::lock_guard lock(pointer_);
  std::erase_if(versions_, [](const auto& version) { return version.expired(); });
  versions_.emplace_back(scene);
  if (!line) {
    old = std::exchange(kept_.back(), std::move(scene));
    return;
  }
  old_lines = log_.add(*std::move(line));
  kept_.push_back(std::move(scene));
  if (kept_.size() <= max_kept_) return;
  old = std::move(kept_.front());
  kept_.pop_front();
}

NamedScene::Kept NamedScene::kept() const {
  const std::lock_guard lock(pointer_);
  return {kept_.front()->version(), kept_.back()->version(), log_.since(), log_.bytes()};
}

std::variant<NamedScene::LogPart, Problem> NamedScene::log_after(std::uint64_t since,
                                                                 std::size_t limit) const {
  const std::lock_guard lock(pointer_);
  const std::uint64_t newest = kept_.back()->version();
  if (since > newest) {
    Problem problem = no_version(newest);
    problem.pointer = "?since";
    return problem;
  }
  if (since < log_.since())
    return Problem{ProblemCode::kLogGone, "the log begins behind version " + std::to_string(log_.since()),
                   "?since"};
  return LogPart{log_.after(since, limit), newest};
}

void NamedScene::drop_history() {
  std::deque<LogLine> lines;  // go after the lock
  std::deque<std::shared_ptr<const scene::Scene>> old;
  const std::lock_guard lock(pointer_);
  lines = log_.clear();
  old.swap(kept_);
  kept_.push_back(std::move(old.back()));
}

Result<std::optional<scene::TreeRefusal>> NamedScene::replace_tree(std::uint32_t mesh_id,
                                                                   const blas::Blas& tree,
                                                                   const std::stop_token& stop) {
  const auto turn = writing_.enter(stop);
  if (!turn || erased_) return Error{ErrorCode::kCancelled, "nobody needs the tree any more", ""};
  auto replaced = scene::replace_tree(*snapshot(), mesh_id, tree);
  if (!replaced) return replaced.error();
  if (const auto* refusal = std::get_if<scene::TreeRefusal>(&*replaced)) return std::optional(*refusal);
  publish(std::get<std::shared_ptr<const scene::Scene>>(*std::move(replaced)), nullptr);
  if (stored_.archive != nullptr) stored_.archive->tree_replaced(stored_.key, snapshot());
  return std::optional<scene::TreeRefusal>();
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

std::variant<std::string, Problem> SceneStore::reserve(std::string id) {
  if (auto problem = check_new(id)) return std::move(*problem);
  const std::lock_guard lock(mutex_);
  while (id.empty()) {
    std::string next = std::string("s").append(std::to_string(next_number_++));
    if (scenes_.find(next) == scenes_.end()) id = std::move(next);
  }
  // Another request may have taken the name since check_new.
  if (!scenes_.emplace(id, Entry{}).second)
    return Problem{ProblemCode::kNameTaken, "a scene of this name exists", "?name"};
  return id;
}

void SceneStore::settle(const std::string& id, Entry entry) {
  const std::lock_guard lock(mutex_);
  scenes_[id] = std::move(entry);
}

std::variant<std::shared_ptr<NamedScene>, Problem> SceneStore::create(
    std::string id, std::shared_ptr<const scene::Scene> first, SceneOrigin origin) {
  auto reserved = reserve(std::move(id));
  if (auto* problem = std::get_if<Problem>(&reserved)) return std::move(*problem);
  const std::string& name = std::get<std::string>(reserved);
  std::int64_t key = 0;
  if (archive_ != nullptr) {
    const std::uint64_t next_number = [this] {
      const std::lock_guard lock(mutex_);
      return next_number_;
    }();
    const auto stored = archive_->create(name, origin, *first, next_number);
    if (!stored) {
      const std::lock_guard lock(mutex_);
      scenes_.erase(name);
      return not_stored(stored.error());
    }
    key = *stored;
  }
  auto scene = std::make_shared<NamedScene>(name, std::move(first), std::move(origin),
                                            NamedScene::Stored{archive_, key}, trees_, history_);
  serve(scene, key);
  return scene;
}

void SceneStore::serve(const std::shared_ptr<NamedScene>& scene, std::int64_t key) {
  const auto snapshot = scene->snapshot();
  if (archive_ != nullptr) archive_->served(key, snapshot);
  settle(scene->id(), {State::kServed, scene, key});
  if (trees_ == nullptr) return;
  for (std::uint32_t mesh_id = 0; mesh_id < snapshot->mesh_count(); ++mesh_id)
    if (better_tree(*snapshot, mesh_id)) trees_->want(scene, mesh_id);
}

std::shared_ptr<NamedScene> SceneStore::find(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  const auto found = scenes_.find(id);
  return found == scenes_.end() ? nullptr : found->second.scene;
}

Problem SceneStore::why_missing(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  const auto found = scenes_.find(id);
  if (found != scenes_.end() && found->second.state == State::kStored)
    return {ProblemCode::kNotReady, "the scene is still being restored", ""};
  if (found != scenes_.end() && found->second.state == State::kDamaged)
    return {ProblemCode::kSceneDamaged, "what is stored of the scene is damaged; the server's log says more",
            ""};
  return no_scene();
}

std::vector<std::shared_ptr<NamedScene>> SceneStore::list() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::shared_ptr<NamedScene>> scenes;
  scenes.reserve(scenes_.size());
  for (const auto& [id, entry] : scenes_)
    if (entry.scene) scenes.push_back(entry.scene);
  return scenes;
}

std::vector<std::string> SceneStore::damaged() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> ids;
  for (const auto& [id, entry] : scenes_)
    if (entry.state == State::kDamaged) ids.push_back(id);
  return ids;
}

void SceneStore::drop_history() {
  for (const std::shared_ptr<NamedScene>& scene : list()) scene->drop_history();
}

std::optional<Problem> SceneStore::erase_damaged(std::string_view id, std::int64_t key) {
  if (const Status erased = archive_->erase(key); !erased) return not_stored(erased.error());
  const std::lock_guard lock(mutex_);
  const auto found = scenes_.find(id);
  if (found != scenes_.end() && found->second.key == key) scenes_.erase(found);
  return std::nullopt;
}

std::optional<Problem> SceneStore::erase(std::string_view id, std::string_view if_match) {
  const std::shared_ptr<NamedScene> scene = find(id);
  if (!scene) {
    const Problem problem = why_missing(id);
    if (problem.code != ProblemCode::kSceneDamaged) return problem;
    const std::int64_t key = [&] {
      const std::lock_guard lock(mutex_);
      const auto found = scenes_.find(id);
      return found == scenes_.end() ? 0 : found->second.key;
    }();
    return erase_damaged(id, key);
  }
  // No version appears between the check and the removal.
  const auto turn = scene->writing_.enter({});
  if (scene->erased_) return no_scene();
  if (auto problem = check_if_match(if_match, scene->snapshot()->version())) return problem;
  if (archive_ != nullptr)
    if (const Status erased = archive_->erase(scene->stored_.key); !erased) return not_stored(erased.error());
  scene->erased_ = true;
  scene->gone_.request_stop();
  const std::lock_guard lock(mutex_);
  scenes_.erase(scenes_.find(id));
  return std::nullopt;
}

SceneStore::SceneStore(std::size_t max_scenes, store::SceneArchive* archive, TreeBuilder* trees,
                       const History& history)
    : max_scenes_(max_scenes), archive_(archive), trees_(trees), history_(history) {
  if (archive_ == nullptr) return;
  // The archive has read all of it once, when it was opened.
  if (auto rows = archive_->scenes()) rows_ = std::move(rows).value();
  if (const auto number = archive_->next_number()) next_number_ = *number;
  for (const store::SceneRow& row : rows_) scenes_[row.id] = {State::kStored, nullptr, row.key};
}

void SceneStore::restore(const std::stop_token& stop, const std::function<void(const DamagedScene&)>& tell) {
  for (const store::SceneRow& row : rows_) {
    if (stop.stop_requested()) return;
    auto scene = archive_->restore(row, stop);
    if (scene) {
      serve(std::make_shared<NamedScene>(row.id, std::move(scene).value(), row.origin,
                                         NamedScene::Stored{archive_, row.key}, trees_, history_),
            row.key);
    } else if (scene.error().code != ErrorCode::kCancelled) {
      settle(row.id, {State::kDamaged, nullptr, row.key});
      tell({row.id, scene.error().message});
    }
  }
  rows_.clear();
  archive_->all_restored();
}

}  // namespace gridcast::server
