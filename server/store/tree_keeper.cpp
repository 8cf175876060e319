#include "server/store/tree_keeper.h"

#include <algorithm>
#include <new>
#include <utility>

#include "core/blas/tree_codec.h"
#include "server/log.h"

namespace gridcast::server::store {
namespace {

bool may_be_encodable(blas::StructureKind asked) {
  return asked == blas::StructureKind::kAuto || blas::is_encodable(asked);
}

/// What an update built, the background may have replaced by the tree that scene::better_tree orders: the
/// store does not hear of it, and it is the one to be preferred.
blas::BuildOptions as_replaced(blas::BuildOptions options, blas::BuildQuality asked) {
  options.quality = asked;
  options.spatial = blas::SpatialSplits::kNever;
  options.motion = blas::MeshMotion::kDeforms;
  return options;
}

}  // namespace

TreeKeeper::TreeKeeper(const std::string& folder, const TreeKeeperOptions& options, DigestOf digest_of)
    : options_(options), digest_of_(std::move(digest_of)), files_(folder, options.bytes) {}

std::unique_ptr<TreeKeeper> TreeKeeper::open(const std::string& folder, const TreeKeeperOptions& options,
                                             DigestOf digest_of) {
  std::unique_ptr<TreeKeeper> keeper(new TreeKeeper(folder, options, std::move(digest_of)));
  if (const Status opened = keeper->files_.open(); !opened) {
    log_warning("built trees are not kept: " + opened.error().message);
    return nullptr;
  }
  keeper->thread_ = std::jthread([raw = keeper.get()](const std::stop_token& stop) { raw->work(stop); });
  return keeper;
}

void TreeKeeper::published(std::int64_t scene_key, const std::shared_ptr<const scene::Scene>& scene,
                           TreeChange change) {
  const std::lock_guard lock(mutex_);
  if (change == TreeChange::kNone) {
    if (const auto waiting = waiting_.find(scene_key); waiting != waiting_.end())
      waiting->second.scene = scene;
    return;
  }
  const auto rest = change == TreeChange::kNew ? std::chrono::milliseconds(0) : options_.rest;
  waiting_[scene_key] = {scene, Clock::now() + rest};
  ++changes_;
  changed_.notify_all();
}

void TreeKeeper::erased(std::int64_t scene_key) {
  const std::lock_guard lock(mutex_);
  waiting_.erase(scene_key);
  wanted_.erase(scene_key);
  if (at_work_ == scene_key) at_work_ = 0;
  unwanted_ = true;
  ++changes_;
  changed_.notify_all();
}

void TreeKeeper::all_restored() {
  const std::lock_guard lock(mutex_);
  all_restored_ = unwanted_ = true;
  ++changes_;
  changed_.notify_all();
}

void TreeKeeper::finish(std::chrono::milliseconds at_most) {
  thread_ = {};
  const auto end = Clock::now() + at_most;
  const Stop late = [end] { return Clock::now() > end; };
  std::unique_lock lock(mutex_);
  while (!late() && keep_one(lock, Clock::time_point::max(), late)) {
  }
  remove_unwanted(lock);
}

TreeCounts TreeKeeper::counts() const {
  const std::lock_guard lock(mutex_);
  TreeCounts counts = counts_;
  counts.bytes = files_.bytes();
  return counts;
}

TreeKeeper::Clock::time_point TreeKeeper::next_due() const {
  Clock::time_point next = Clock::now() + std::chrono::hours(1);
  for (const auto& [key, waiting] : waiting_) next = std::min(next, waiting.due);
  return next;
}

void TreeKeeper::work(const std::stop_token& stop) {
  const Stop stopped = [&stop] { return stop.stop_requested(); };
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    if (keep_one(lock, Clock::now(), stopped) || remove_unwanted(lock)) continue;
    const std::uint64_t seen = changes_;
    changed_.wait_until(lock, stop, next_due(), [&] { return changes_ != seen; });
  }
}

bool TreeKeeper::keep_one(std::unique_lock<std::mutex>& lock, Clock::time_point now, const Stop& stop) {
  const auto due = std::ranges::find_if(waiting_, [now](const auto& one) { return one.second.due <= now; });
  if (due == waiting_.end()) return false;
  const auto [key, waiting] = *due;
  waiting_.erase(due);
  at_work_ = key;
  lock.unlock();
  std::optional<std::set<Digest>> wanted;
  auto scene = waiting.scene.lock();
  const bool alive = scene != nullptr;
  if (alive) wanted = keep(*scene, stop);
  scene.reset();  // perhaps the last to hold it
  lock.lock();
  if (at_work_ == key) {
    if (wanted)
      wanted_[key] = *std::move(wanted);
    else if (alive)  // the rest is for whoever comes next, unless there is a newer version by then
      waiting_.try_emplace(key, waiting);
  }
  at_work_ = 0;
  unwanted_ = true;
  return true;
}

bool TreeKeeper::remove_unwanted(std::unique_lock<std::mutex>& lock) {
  const auto is_known = [this](const auto& one) { return wanted_.contains(one.first); };
  if (!unwanted_ || !all_restored_ || !std::ranges::all_of(waiting_, is_known)) return false;
  unwanted_ = false;
  std::set<Digest> wanted;
  for (const auto& [key, trees] : wanted_) wanted.insert(trees.begin(), trees.end());
  lock.unlock();
  files_.keep_only(wanted);
  lock.lock();
  return true;
}

std::optional<std::set<Digest>> TreeKeeper::keep(const scene::Scene& scene, const Stop& stop) try {
  std::set<Digest> wanted;
  for (std::uint32_t mesh_id = 0; mesh_id < scene.mesh_count(); ++mesh_id) {
    const blas::Blas& blas = scene.blas(mesh_id);
    if (!blas::is_encodable(blas.stats().kind) || blas.mesh().triangle_count() < options_.least_triangles)
      continue;
    if (stop()) return std::nullopt;
    const Digest key = tree_key(digest_of_(blas.mesh_ptr()), blas.options());
    if (wanted.insert(key).second && !files_.contains(key)) write(key, blas);
  }
  return wanted;
} catch (const std::bad_alloc&) {
  log_warning("built trees are not kept: not enough memory");
  return std::set<Digest>();
}

void TreeKeeper::write(const Digest& key, const blas::Blas& blas) {
  const auto bytes = blas::encode_tree(blas);
  const Status written = bytes ? files_.put(key, *bytes) : bytes.error();
  if (!written) log_warning("a built tree is not kept: " + written.error().message);
  const std::lock_guard lock(mutex_);
  (written ? counts_.kept : counts_.failures) += 1;
}

scene::TreeFinder TreeKeeper::finder(std::int64_t scene_key, blas::BuildQuality asked) {
  return [this, scene_key, asked](const scene::MeshState& wanted) { return find(scene_key, wanted, asked); };
}

std::optional<blas::Blas> TreeKeeper::find(std::int64_t scene_key, const scene::MeshState& wanted,
                                           blas::BuildQuality asked) try {
  if (!may_be_encodable(wanted.build.kind) || wanted.mesh->triangle_count() < options_.least_triangles ||
      files_.empty())
    return std::nullopt;
  const Digest mesh = digest_of_(wanted.mesh);
  for (const blas::BuildOptions& options : {as_replaced(wanted.build, asked), wanted.build}) {
    const Digest key = tree_key(mesh, options);
    auto tree = read(key, mesh, wanted.mesh);
    if (!tree) continue;
    const std::lock_guard lock(mutex_);
    wanted_[scene_key].insert(key);
    ++counts_.found;
    return tree;
  }
  return std::nullopt;
} catch (const std::bad_alloc&) {
  return std::nullopt;
}

std::optional<blas::Blas> TreeKeeper::read(const Digest& key, const Digest& mesh_digest,
                                           const std::shared_ptr<const mesh::TriangleMesh>& mesh) {
  if (!files_.contains(key)) return std::nullopt;
  const auto file = files_.get(key);
  if (!file) {
    reject(key, file.error().message);
    return std::nullopt;
  }
  auto tree = blas::decode_tree(mesh, file->tree());
  if (!tree) {
    if (tree.error().code != ErrorCode::kLimitExceeded)
      reject(key, files_.path_of(key) + ": " + tree.error().message + " " + tree.error().where);
    return std::nullopt;
  }
  if (tree_key(mesh_digest, tree->options()) != key) {
    reject(key, files_.path_of(key) + " was built with other options");
    return std::nullopt;
  }
  return *std::move(tree);
}

void TreeKeeper::reject(const Digest& key, const std::string& why) {
  log_warning("a kept tree is not used, but built anew: " + why);
  files_.remove(key);
  const std::lock_guard lock(mutex_);
  ++counts_.rejected;
}

}  // namespace gridcast::server::store
