#pragma once

#include <array>

namespace gridcast::server::store {

/// "GCST" as a number: SQLite's application_id, so that no other program's database is taken for ours.
inline constexpr int kApplicationId = 0x47435354;

/// kMigrations[v] turns schema version v into v + 1; 0 is an empty file. What is here was released: it is
/// never edited, a change is one more entry.
inline constexpr std::array kMigrations{
    R"(
CREATE TABLE scenes(
  key INTEGER PRIMARY KEY AUTOINCREMENT,
  id TEXT NOT NULL UNIQUE,
  structure TEXT NOT NULL,
  import_ms REAL NOT NULL,
  build_ms REAL NOT NULL,
  snapshot_version INTEGER NOT NULL,
  snapshot BLOB NOT NULL,
  files BLOB NOT NULL,     -- digests that the snapshot needs, one after the other
  checksum BLOB NOT NULL,  -- SHA-256 of the columns before
  version INTEGER NOT NULL
) STRICT;
CREATE TABLE updates(
  scene INTEGER NOT NULL REFERENCES scenes(key) ON DELETE CASCADE,
  version INTEGER NOT NULL,
  delta BLOB NOT NULL,     -- empty when it is in a file
  file BLOB NOT NULL,      -- its digest, else empty
  checksum BLOB NOT NULL,  -- SHA-256 of the columns before
  PRIMARY KEY(scene, version)
) STRICT, WITHOUT ROWID;
CREATE TABLE numbers(name TEXT PRIMARY KEY, value INTEGER NOT NULL) STRICT, WITHOUT ROWID;
INSERT INTO numbers VALUES('next_scene', 1);
)",
};

}  // namespace gridcast::server::store
