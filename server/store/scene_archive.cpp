#include "server/store/scene_archive.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <functional>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/log.h"
#include "server/store/known_files.h"
#include "server/store/scene_codec.h"

namespace gridcast::server::store {
namespace {

/// Larger updates go into a file of their own: SQLite would write them twice, to its log and to its pages.
constexpr std::size_t kMaxInlineBytes = 64 << 10;
/// What a row takes beside its delta, about.
constexpr std::uint64_t kRowBytes = 100;

Error damaged(const SceneRow& row, const std::string& what) {
  return {ErrorCode::kInvalidFile, "scene " + row.id + ": " + what, ""};
}

Status make_folder(const std::string& path) {
  if (::mkdir(path.c_str(), 0700) == 0) {
    const std::string parent = std::filesystem::absolute(path).parent_path().string();
    return sync_folder(parent);
  }
  if (errno != EEXIST) return system_error("making", path, errno);
  return ok_status();
}

/// The lock lasts as long as the descriptor: a killed process leaves none behind.
Result<int> take_folder(const std::string& folder) {
  const std::string path = folder + "/lock";
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (fd < 0) return system_error("opening", path, errno);
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  const int failed = errno;
  ::close(fd);
  if (failed == EWOULDBLOCK)
    return Error{ErrorCode::kConflict, folder + " is in use by another gridcast: one server, one data folder",
                 ""};
  return system_error("locking", path, failed);
}

}  // namespace

SceneArchive::SceneArchive(std::string folder, int lock_fd, const ArchiveOptions& options)
    : folder_(std::move(folder)),
      lock_fd_(lock_fd),
      options_(options),
      files_(folder_ + "/files"),
      known_(std::make_unique<KnownFiles>()) {}

SceneArchive::~SceneArchive() {
  maintenance_ = {};
  trees_.reset();
  database_.reset();
  ::close(lock_fd_);
}

Result<std::unique_ptr<SceneArchive>> SceneArchive::open(const std::string& folder,
                                                         const ArchiveOptions& options) {
  if (Status made = make_folder(folder); !made) return made.error();
  const auto lock = take_folder(folder);
  if (!lock) return lock.error();
  std::unique_ptr<SceneArchive> archive(new SceneArchive(folder, *lock, options));
  if (Status made = make_folder(folder + "/files"); !made) return made.error();
  auto database = Database::open(folder + "/gridcast.db");
  if (!database) return database.error();
  archive->database_ = std::move(database).value();
  if (Status synced = sync_folder(folder); !synced) return synced.error();
  // What a crash left behind.
  if (Status collected = archive->collect_garbage(); !collected) return collected.error();
  if (options.trees.bytes != 0)
    archive->trees_ =
        TreeKeeper::open(folder + "/structures", options.trees,
                         [raw = archive.get()](const auto& mesh) { return raw->digest_of(mesh); });
  archive->maintenance_ =
      std::jthread([raw = archive.get()](const std::stop_token& stop) { raw->maintain(stop); });
  return archive;
}

Status SceneArchive::counted(Status status) {
  if (status || status.error().code == ErrorCode::kNotFound) return status;
  log_error("not stored: " + status.error().message);
  const std::lock_guard lock(mutex_);
  ++failures_;
  return status;
}

Result<Digest> SceneArchive::put_known(const std::shared_ptr<const void>& thing, std::uint64_t& bytes,
                                       const std::function<std::string()>& encoded) {
  // It may have gone since, when nothing stored referred to it.
  if (const auto known = known_->find(thing); known && files_.contains(*known)) return *known;
  const std::string text = encoded();
  bytes += text.size();
  auto file = files_.put(text);
  if (file) known_->add(thing, *file);
  return file;
}

Digest SceneArchive::digest_of(const std::shared_ptr<const mesh::TriangleMesh>& mesh) {
  if (const auto known = known_->find(mesh)) return *known;
  const Digest digest = sha256(encode(*mesh));
  known_->add(mesh, digest);
  return digest;
}

Result<SceneArchive::Written> SceneArchive::write_snapshot(const scene::Scene& scene) {
  scene::SceneState state = state_of(scene);
  Written written;
  Snapshot snapshot{state.version,
                    state.build,
                    {},
                    state.pose,
                    {},
                    {},
                    std::move(state.instances),
                    std::move(state.added_names),
                    std::move(state.new_names)};
  const auto put = [&](const std::shared_ptr<const void>& thing,
                       const std::function<std::string()>& encoded) {
    auto file = put_known(thing, written.bytes, encoded);
    if (file) written.files.push_back(*file);
    return file;
  };
  const auto data = put(state.data, [&] { return encode(*state.data); });
  if (!data) return data.error();
  snapshot.data = *data;
  for (const auto& mesh : state.data->meshes) {
    const auto file = put(mesh, [&] { return encode(*mesh); });
    if (!file) return file.error();
    snapshot.source_meshes.push_back(*file);
  }
  for (const scene::MeshState& mesh : state.meshes) {
    const auto file = put(mesh.mesh, [&] { return encode(*mesh.mesh); });
    if (!file) return file.error();
    snapshot.meshes.push_back({*file, mesh.build});
  }
  const std::string bytes = encode(snapshot);
  const auto file = files_.put(bytes);
  if (!file) return file.error();
  written.snapshot = *file;
  written.files.push_back(*file);
  written.bytes += bytes.size();
  const std::set<Digest> distinct(written.files.begin(), written.files.end());
  written.files.assign(distinct.begin(), distinct.end());
  return written;
}

Result<std::int64_t> SceneArchive::create(const std::string& id, const SceneOrigin& origin,
                                          const scene::Scene& first, std::uint64_t next_number) {
  const std::shared_lock referring(referring_);
  const auto written = write_snapshot(first);
  if (!written) return counted(written.error()).error();
  const std::uint64_t version = first.version();
  auto key = database_->create({0, id, origin, version, written->snapshot, written->files, version, true},
                               next_number);
  if (!key) return counted(key.error()).error();
  const std::lock_guard lock(mutex_);
  logs_[*key] = {0, written->bytes};
  return key;
}

Status SceneArchive::append(std::int64_t key, const scene::Scene& before,
                            const std::shared_ptr<const scene::Scene>& after) {
  const scene::SceneDelta delta = difference(before, *after);
  UpdateRow update{after->version(), encode(delta), std::nullopt, true};
  const std::uint64_t bytes = update.delta.size() + kRowBytes;
  {
    const std::shared_lock referring(referring_);
    if (update.delta.size() > kMaxInlineBytes) {
      const auto file = files_.put(update.delta);
      if (!file) return counted(file.error());
      update.file = *file;
      update.delta.clear();
    }
    if (Status stored = database_->append(key, update); !stored) return counted(stored);
  }
  grown(key, bytes, after);
  if (trees_) trees_->published(key, after, delta.meshes.empty() ? TreeChange::kNone : TreeChange::kMoved);
  return ok_status();
}

void SceneArchive::grown(std::int64_t key, std::uint64_t bytes,
                         const std::shared_ptr<const scene::Scene>& after) {
  const std::lock_guard lock(mutex_);
  Log& log = logs_[key];
  log.bytes += bytes;
  if (log.bytes <= std::max(options_.log_bytes, log.snapshot_bytes)) return;
  due_[key] = after;
  changed_.notify_all();
}

Status SceneArchive::erase(std::int64_t key) {
  if (Status erased = database_->erase(key); !erased) return counted(erased);
  if (trees_) trees_->erased(key);
  const std::lock_guard lock(mutex_);
  logs_.erase(key);
  due_.erase(key);
  garbage_ = true;
  changed_.notify_all();
  return ok_status();
}

void SceneArchive::maintain(const std::stop_token& stop) {
  while (true) {
    std::map<std::int64_t, std::shared_ptr<const scene::Scene>> due;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [&] { return garbage_ || !due_.empty(); })) return;
      due = std::exchange(due_, {});
      garbage_ = false;
    }
    for (const auto& [key, scene] : due) {
      if (stop.stop_requested()) return;
      compact(key, scene);
    }
    // Scenes need no longer live for it.
    due.clear();
    if (Status collected = collect_garbage(); !collected)
      log_warning("files without use are left: " + collected.error().message);
  }
}

void SceneArchive::compact(std::int64_t key, const std::shared_ptr<const scene::Scene>& scene) {
  Status done = ok_status();
  std::uint64_t bytes = 0;
  {
    const std::shared_lock referring(referring_);
    const auto written = write_snapshot(*scene);
    done = written ? database_->compact(key, scene->version(), written->snapshot, written->files)
                   : written.error();
    if (written) bytes = written->bytes;
  }
  const Status reported = counted(done);
  const std::lock_guard lock(mutex_);
  const auto log = logs_.find(key);
  if (log == logs_.end()) return;
  // The log is as good as a snapshot: after a failure the next try comes when it has grown as much again.
  log->second = {0, done ? std::max(bytes, log->second.snapshot_bytes / 2) : log->second.bytes};
  if (reported) ++compactions_;
}

Status SceneArchive::collect_garbage() {
  const std::unique_lock nobody_refers(referring_);
  const auto scenes = database_->scenes();
  if (!scenes) return scenes.error();
  // What a damaged row referred to may still help to save its scene.
  for (const SceneRow& scene : *scenes)
    if (!scene.intact) return ok_status();
  const auto there = files_.sweep();
  if (!there) return there.error();
  const auto used = database_->files_in_use();
  if (!used) return used.error();
  for (const Digest& file : *there)
    if (!used->contains(file)) files_.remove(file);
  return ok_status();
}

Result<std::shared_ptr<const mesh::TriangleMesh>> SceneArchive::read_mesh(
    const Digest& digest, std::map<Digest, std::shared_ptr<const mesh::TriangleMesh>>& read) {
  if (const auto found = read.find(digest); found != read.end()) return found->second;
  const auto bytes = files_.get(digest);
  if (!bytes) return bytes.error();
  auto decoded = decode_mesh(*bytes);
  if (!decoded)
    return Error{decoded.error().code, "mesh " + to_hex(digest) + ": " + decoded.error().message, ""};
  auto mesh = std::make_shared<const mesh::TriangleMesh>(std::move(decoded).value());
  read.emplace(digest, mesh);
  known_->add(mesh, digest);
  return mesh;
}

Result<scene::SceneState> SceneArchive::read_snapshot(const SceneRow& row, Log& log) {
  const auto bytes = files_.get(row.snapshot);
  if (!bytes) return bytes.error();
  auto decoded = decode_snapshot(*bytes);
  if (!decoded) return decoded.error();
  Snapshot& snapshot = decoded.value();
  const auto data_bytes = files_.get(snapshot.data);
  if (!data_bytes) return data_bytes.error();
  log.snapshot_bytes = bytes->size() + data_bytes->size();
  auto data = decode_data(*data_bytes);
  if (!data) return data.error();
  std::map<Digest, std::shared_ptr<const mesh::TriangleMesh>> meshes;
  for (const Digest& digest : snapshot.source_meshes) {
    auto mesh = read_mesh(digest, meshes);
    if (!mesh) return mesh.error();
    data->meshes.push_back(std::move(mesh).value());
  }
  auto shared_data = std::make_shared<const scene::SceneData>(std::move(data).value());
  known_->add(shared_data, snapshot.data);
  scene::SceneState state{snapshot.version,
                          snapshot.build,
                          std::move(shared_data),
                          std::move(snapshot.pose),
                          {},
                          std::move(snapshot.instances),
                          std::move(snapshot.added_names),
                          std::move(snapshot.new_names)};
  for (const StoredMesh& stored : snapshot.meshes) {
    auto mesh = read_mesh(stored.file, meshes);
    if (!mesh) return mesh.error();
    state.meshes.push_back({std::move(mesh).value(), stored.build});
  }
  return state;
}

Result<scene::SceneState> SceneArchive::read_state(const SceneRow& row, Log& log) {
  if (!row.intact) return damaged(row, "its row in the database is damaged");
  auto state = read_snapshot(row, log);
  if (!state) return damaged(row, state.error().message);
  if (state->version != row.snapshot_version) return damaged(row, "its snapshot is of another version");
  const auto updates = database_->updates(row.key);
  if (!updates) return damaged(row, updates.error().message);
  DeltaReplay replay(state.value());
  for (const UpdateRow& update : *updates) {
    const std::string which = "update " + std::to_string(update.version) + ": ";
    if (!update.intact) return damaged(row, which + "its row in the database is damaged");
    std::string delta = update.delta;
    if (update.file) {
      auto bytes = files_.get(*update.file);
      if (!bytes) return damaged(row, which + bytes.error().message);
      delta = std::move(bytes).value();
    }
    log.bytes += delta.size() + kRowBytes;
    if (Status applied = replay.apply(delta); !applied) return damaged(row, which + applied.error().message);
  }
  if (state->version != row.version)
    return damaged(row, "its updates end at version " + std::to_string(state->version) + " of " +
                            std::to_string(row.version));
  return state;
}

Result<std::shared_ptr<const scene::Scene>> SceneArchive::restore(const SceneRow& row,
                                                                  const std::stop_token& stop) {
  Log log;
  auto state = read_state(row, log);
  if (!state) return state.error();
  const auto find_tree = trees_ ? trees_->finder(row.key, state->build.quality) : scene::TreeFinder();
  auto scene = restore_scene(std::move(state).value(), {{}, stop, {}}, find_tree);
  if (!scene && scene.error().code != ErrorCode::kCancelled)
    return damaged(row, scene.error().message + " (" + scene.error().where + ")");
  if (!scene) return scene;
  const std::lock_guard lock(mutex_);
  logs_[row.key] = log;
  return scene;
}

void SceneArchive::served(std::int64_t key, const std::shared_ptr<const scene::Scene>& scene) {
  if (trees_) trees_->published(key, scene, TreeChange::kNew);
}

void SceneArchive::tree_replaced(std::int64_t key, const std::shared_ptr<const scene::Scene>& scene) {
  if (trees_) trees_->published(key, scene, TreeChange::kMoved);
}

void SceneArchive::all_restored() {
  if (trees_) trees_->all_restored();
}

void SceneArchive::finish(std::chrono::milliseconds at_most) {
  if (trees_) trees_->finish(at_most);
}

ArchiveCounts SceneArchive::counts() const {
  const TreeCounts trees = trees_ ? trees_->counts() : TreeCounts();
  const std::lock_guard lock(mutex_);
  return {database_->commits(), compactions_, failures_, files_.bytes_written(), trees};
}

}  // namespace gridcast::server::store
