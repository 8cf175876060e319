#include "server/store/database.h"

#include <atomic>
#include <cstring>
#include <mutex>
#include <utility>

#include <sqlite3.h>

#include "server/store/commit_queue.h"
#include "server/store/schema.h"

namespace gridcast::server::store {
namespace {

Error error_of(sqlite3* db, std::string_view doing) {
  ErrorCode code = ErrorCode::kIo;
  switch (sqlite3_errcode(db)) {
    case SQLITE_FULL:
      code = ErrorCode::kLimitExceeded;
      break;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      code = ErrorCode::kInvalidFile;
      break;
    default:
      break;
  }
  return {code, std::string(doing) + ": " + sqlite3_errmsg(db), ""};
}

std::string_view view_of(const Digest& digest) {
  return {reinterpret_cast<const char*>(digest.data()), digest.size()};
}

/// A prepared statement. Binding or stepping one that did not compile fails.
class Statement {
 public:
  Statement(sqlite3* db, const char* sql) : db_(db) { sqlite3_prepare_v2(db, sql, -1, &statement_, nullptr); }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& number(std::int64_t value) {
    sqlite3_bind_int64(statement_, ++bound_, value);
    return *this;
  }
  Statement& real(double value) {
    sqlite3_bind_double(statement_, ++bound_, value);
    return *this;
  }
  /// The caller keeps the bytes until the statement has run.
  Statement& text(std::string_view value) {
    sqlite3_bind_text(statement_, ++bound_, value.data(), int(value.size()), SQLITE_STATIC);
    return *this;
  }
  Statement& blob(std::string_view value) {
    // A null pointer would bind NULL.
    sqlite3_bind_blob(statement_, ++bound_, value.empty() ? "" : value.data(), int(value.size()),
                      SQLITE_STATIC);
    return *this;
  }

  /// A row is there to be read; else see status().
  bool row() {
    code_ = statement_ == nullptr ? SQLITE_ERROR : sqlite3_step(statement_);
    return code_ == SQLITE_ROW;
  }
  [[nodiscard]] Status status(std::string_view doing) const {
    if (code_ == SQLITE_DONE || code_ == SQLITE_ROW) return ok_status();
    return error_of(db_, doing);
  }
  Status run(std::string_view doing) {
    while (row()) continue;
    return status(doing);
  }
  [[nodiscard]] std::int64_t number_at(int column) { return sqlite3_column_int64(statement_, column); }
  [[nodiscard]] double real_at(int column) { return sqlite3_column_double(statement_, column); }
  [[nodiscard]] std::string bytes_at(int column) {
    const void* data = sqlite3_column_blob(statement_, column);
    const auto size = std::size_t(sqlite3_column_bytes(statement_, column));
    return data == nullptr ? std::string() : std::string(static_cast<const char*>(data), size);
  }

 private:
  sqlite3* db_;
  sqlite3_stmt* statement_ = nullptr;
  int bound_ = 0;
  int code_ = SQLITE_DONE;
};

Status execute(sqlite3* db, const char* sql) {
  if (sqlite3_exec(db, sql, nullptr, nullptr, nullptr) == SQLITE_OK) return ok_status();
  return error_of(db, "the database");
}

std::string number_bytes(std::uint64_t value) {
  return std::to_string(value) + "\n";
}

std::string joined(const std::vector<Digest>& digests) {
  std::string bytes;
  for (const Digest& digest : digests) bytes.append(view_of(digest));
  return bytes;
}

std::optional<Digest> digest_of(std::string_view bytes) {
  Digest digest{};
  if (bytes.size() != digest.size()) return std::nullopt;
  std::memcpy(digest.data(), bytes.data(), digest.size());
  return digest;
}

std::vector<Digest> split(const std::string& bytes) {
  std::vector<Digest> digests;
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(Digest))
    if (const auto digest = digest_of(std::string_view(bytes).substr(at, sizeof(Digest))))
      digests.push_back(*digest);
  return digests;
}

/// `version` is not in it: it changes with every update, and the updates themselves must add up to it.
Digest checksum_of(const SceneRow& scene) {
  return sha256(scene.id + "\n" + scene.origin.structure + "\n" + number_bytes(scene.snapshot_version) +
                std::string(view_of(scene.snapshot)) + joined(scene.files));
}

Digest checksum_of(std::int64_t key, const UpdateRow& update) {
  return sha256(number_bytes(std::uint64_t(key)) + number_bytes(update.version) +
                (update.file ? std::string(view_of(*update.file)) : std::string()) + "\n" + update.delta);
}

Result<std::int64_t> pragma_number(sqlite3* db, const char* sql) {
  Statement statement(db, sql);
  if (statement.row()) return statement.number_at(0);
  if (Status status = statement.status("the database"); !status) return status.error();
  return Error{ErrorCode::kInvalidFile, "the database has no version", ""};
}

Status migrate(sqlite3* db) {
  const auto version = pragma_number(db, "PRAGMA user_version");
  if (!version) return version.error();
  const auto application = pragma_number(db, "PRAGMA application_id");
  if (!application) return application.error();
  const auto newest = std::int64_t(kMigrations.size());
  if (*version != 0 && *application != kApplicationId)
    return Error{ErrorCode::kInvalidFile, "the database belongs to another program", ""};
  if (*version > newest)
    return Error{ErrorCode::kUnsupported,
                 "the database has schema version " + std::to_string(*version) + ", this program knows " +
                     std::to_string(newest) + ": a newer gridcast wrote it",
                 ""};
  for (auto v = std::size_t(*version); v < kMigrations.size(); ++v) {
    const std::string sql = std::string("BEGIN IMMEDIATE;") + kMigrations[v] +
                            "PRAGMA application_id=" + std::to_string(kApplicationId) +
                            ";PRAGMA user_version=" + std::to_string(v + 1) + ";COMMIT;";
    if (Status status = execute(db, sql.c_str()); !status) return status;
  }
  return ok_status();
}

Status check_pages(sqlite3* db) {
  Statement check(db, "PRAGMA quick_check(1)");
  if (!check.row()) return check.status("the database");
  const std::string verdict = check.bytes_at(0);
  if (verdict == "ok") return ok_status();
  return Error{ErrorCode::kInvalidFile, "the database is damaged: " + verdict, ""};
}

}  // namespace

struct Database::Impl {
  explicit Impl(sqlite3* opened) : db(opened), queue([this](const auto& batch) { commit(batch); }) {}
  ~Impl() { sqlite3_close(db); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  using Batch = std::vector<std::pair<CommitQueue::Work*, Status*>>;

  /// One transaction; a work that fails is taken back alone, a commit that fails fails all.
  void commit(const Batch& batch) {
    const std::lock_guard lock(mutex);
    Status all = execute(db, "BEGIN IMMEDIATE");
    for (const auto& [work, status] : batch) {
      if (!all) break;
      all = execute(db, "SAVEPOINT one");
      if (!all) break;
      *status = (*work)();
      all = execute(db, *status ? "RELEASE one" : "ROLLBACK TO one; RELEASE one");
    }
    if (all) all = execute(db, "COMMIT");
    if (all) {
      ++commits;
      return;
    }
    // SQLite may have rolled back by itself.
    if (sqlite3_get_autocommit(db) == 0) (void)execute(db, "ROLLBACK");
    for (const auto& [work, status] : batch)
      if (*status) *status = all.error();
  }

  sqlite3* db;
  std::mutex mutex;  ///< of the connection
  std::atomic<std::uint64_t> commits{0};
  CommitQueue queue;
};

Database::Database(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Database::~Database() = default;

Result<std::unique_ptr<Database>> Database::open(const std::string& path) {
  sqlite3* db = nullptr;
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_NOFOLLOW;
  const int code = sqlite3_open_v2(path.c_str(), &db, flags, nullptr);
  auto impl = std::make_unique<Impl>(db);
  const auto named = [&](const Error& error) { return Error{error.code, path + ": " + error.message, ""}; };
  if (code != SQLITE_OK) return named(error_of(db, "opening it"));
  // Exclusive: the log's index lives in memory, and a second program is refused.
  const char* settings =
      "PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA "
      "foreign_keys=ON;"
      "PRAGMA journal_size_limit=16777216; PRAGMA trusted_schema=OFF; PRAGMA cell_size_check=ON";
  if (Status status = execute(db, settings); !status) return named(status.error());
  if (Status status = check_pages(db); !status) return named(status.error());
  if (Status status = migrate(db); !status) return named(status.error());
  return std::unique_ptr<Database>(new Database(std::move(impl)));
}

Result<std::int64_t> Database::create(const SceneRow& scene, std::uint64_t next_number) {
  const Digest checksum = checksum_of(scene);
  const std::string files = joined(scene.files);
  std::int64_t key = 0;
  const Status status = impl_->queue.run([&]() -> Status {
    Statement insert(impl_->db, "INSERT INTO scenes VALUES(NULL,?,?,?,?,?,?,?,?,?)");
    insert.text(scene.id)
        .text(scene.origin.structure)
        .real(scene.origin.import_ms)
        .real(scene.origin.build_ms);
    insert.number(std::int64_t(scene.snapshot_version)).blob(view_of(scene.snapshot)).blob(files);
    insert.blob(view_of(checksum)).number(std::int64_t(scene.version));
    if (Status inserted = insert.run("storing the scene"); !inserted) return inserted;
    key = sqlite3_last_insert_rowid(impl_->db);
    Statement number(impl_->db, "UPDATE numbers SET value=max(value,?) WHERE name='next_scene'");
    return number.number(std::int64_t(next_number)).run("storing the scene");
  });
  if (!status) return status.error();
  return key;
}

Status Database::append(std::int64_t key, const UpdateRow& update) {
  const Digest checksum = checksum_of(key, update);
  return impl_->queue.run([&]() -> Status {
    Statement version(impl_->db, "UPDATE scenes SET version=? WHERE key=? AND version=?-1");
    version.number(std::int64_t(update.version)).number(key).number(std::int64_t(update.version));
    if (Status updated = version.run("storing the update"); !updated) return updated;
    if (sqlite3_changes(impl_->db) != 1) return Error{ErrorCode::kNotFound, "the scene is gone", ""};
    Statement insert(impl_->db, "INSERT INTO updates VALUES(?,?,?,?,?)");
    insert.number(key).number(std::int64_t(update.version)).blob(update.delta);
    insert.blob(update.file ? view_of(*update.file) : std::string_view()).blob(view_of(checksum));
    return insert.run("storing the update");
  });
}

Status Database::erase(std::int64_t key) {
  return impl_->queue.run([&] {
    return Statement(impl_->db, "DELETE FROM scenes WHERE key=?").number(key).run("deleting the scene");
  });
}

Status Database::compact(std::int64_t key, std::uint64_t version, const Digest& snapshot,
                         const std::vector<Digest>& files) {
  const std::string joined_files = joined(files);
  return impl_->queue.run([&]() -> Status {
    SceneRow scene;
    Statement read(impl_->db, "SELECT id,structure FROM scenes WHERE key=? AND version>=?");
    if (!read.number(key).number(std::int64_t(version)).row()) {
      if (Status status = read.status("compacting the updates"); !status) return status;
      return Error{ErrorCode::kNotFound, "the scene is gone", ""};
    }
    scene.id = read.bytes_at(0);
    scene.origin.structure = read.bytes_at(1);
    scene.snapshot_version = version;
    scene.snapshot = snapshot;
    scene.files = files;
    const Digest checksum = checksum_of(scene);
    Statement update(impl_->db,
                     "UPDATE scenes SET snapshot_version=?,snapshot=?,files=?,checksum=? WHERE key=?");
    update.number(std::int64_t(version)).blob(view_of(snapshot)).blob(joined_files).blob(view_of(checksum));
    if (Status updated = update.number(key).run("compacting the updates"); !updated) return updated;
    Statement drop(impl_->db, "DELETE FROM updates WHERE scene=? AND version<=?");
    return drop.number(key).number(std::int64_t(version)).run("compacting the updates");
  });
}

Result<std::vector<SceneRow>> Database::scenes() {
  const std::lock_guard lock(impl_->mutex);
  Statement read(
      impl_->db,
      "SELECT key,id,structure,import_ms,build_ms,snapshot_version,snapshot,files,checksum,version "
      "FROM scenes ORDER BY id");
  std::vector<SceneRow> scenes;
  while (read.row()) {
    SceneRow& scene = scenes.emplace_back();
    scene.key = read.number_at(0);
    scene.id = read.bytes_at(1);
    scene.origin = {read.bytes_at(2), read.real_at(3), read.real_at(4)};
    scene.snapshot_version = std::uint64_t(read.number_at(5));
    const auto snapshot = digest_of(read.bytes_at(6));
    scene.snapshot = snapshot.value_or(Digest{});
    scene.files = split(read.bytes_at(7));
    scene.version = std::uint64_t(read.number_at(9));
    scene.intact = snapshot && read.bytes_at(8) == view_of(checksum_of(scene));
  }
  if (Status status = read.status("reading the scenes"); !status) return status.error();
  return scenes;
}

Result<std::vector<UpdateRow>> Database::updates(std::int64_t key) {
  const std::lock_guard lock(impl_->mutex);
  Statement read(impl_->db, "SELECT version,delta,file,checksum FROM updates WHERE scene=? ORDER BY version");
  read.number(key);
  std::vector<UpdateRow> updates;
  while (read.row()) {
    UpdateRow& update = updates.emplace_back();
    update.version = std::uint64_t(read.number_at(0));
    update.delta = read.bytes_at(1);
    update.file = digest_of(read.bytes_at(2));
    update.intact = read.bytes_at(3) == view_of(checksum_of(key, update));
  }
  if (Status status = read.status("reading the updates"); !status) return status.error();
  return updates;
}

Result<std::set<Digest>> Database::files_in_use() {
  const std::lock_guard lock(impl_->mutex);
  std::set<Digest> files;
  Statement scenes(impl_->db, "SELECT files,snapshot FROM scenes");
  while (scenes.row()) {
    for (const Digest& digest : split(scenes.bytes_at(0))) files.insert(digest);
    if (const auto snapshot = digest_of(scenes.bytes_at(1))) files.insert(*snapshot);
  }
  if (Status status = scenes.status("reading the scenes"); !status) return status.error();
  Statement updates(impl_->db, "SELECT file FROM updates WHERE length(file)>0");
  while (updates.row())
    if (const auto digest = digest_of(updates.bytes_at(0))) files.insert(*digest);
  if (Status status = updates.status("reading the updates"); !status) return status.error();
  return files;
}

Result<std::uint64_t> Database::next_number() {
  const std::lock_guard lock(impl_->mutex);
  Statement read(impl_->db, "SELECT value FROM numbers WHERE name='next_scene'");
  if (read.row()) return std::uint64_t(read.number_at(0));
  if (Status status = read.status("reading the numbers"); !status) return status.error();
  return Error{ErrorCode::kInvalidFile, "the database has no number for the next scene", ""};
}

std::uint64_t Database::commits() const {
  return impl_->commits;
}

}  // namespace gridcast::server::store
