#include "core/mesh/weld.h"

#include <algorithm>
#include <tuple>

namespace gridcast::mesh {
namespace {

// Sorted as a value of 16 bytes: an index sort would miss the cache at every comparison.
struct Entry {
  Vec3f position;
  std::uint32_t vertex;
};

bool same_place(const Entry& a, const Entry& b) {
  return a.position.x == b.position.x && a.position.y == b.position.y && a.position.z == b.position.z;
}

bool before(const Entry& a, const Entry& b) {
  return std::tie(a.position.x, a.position.y, a.position.z, a.vertex) <
         std::tie(b.position.x, b.position.y, b.position.z, b.vertex);
}

}  // namespace

std::vector<std::uint32_t> weld_vertices(const TriangleMesh& mesh) {
  std::vector<Entry> entries(mesh.positions.size());
  for (std::uint32_t i = 0; i < entries.size(); ++i) entries[i] = {mesh.positions[i], i};
  std::sort(entries.begin(), entries.end(), before);

  std::vector<std::uint32_t> first(entries.size());
  std::size_t group = 0;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!same_place(entries[group], entries[i])) group = i;
    first[entries[i].vertex] = entries[group].vertex;
  }
  return first;
}

}  // namespace gridcast::mesh
