#include "server/import/import_order.h"

#include <optional>
#include <utility>

#include "server/store/bytes.h"
#include "server/store/scene_codec.h"

namespace gridcast::server {

/// What an answer begins with.
struct Outcome {
  bool done = false;
  ErrorCode code = ErrorCode::kInternal;
  std::string message;
  std::string where;
};

namespace store {

template <>
inline constexpr int kEnumerators<ErrorCode> = int(ErrorCode::kInternal) + 1;

template <class A>
void fields(A& archive, Is<io::GltfLimits> auto& limits) {
  auto& [file_bytes, json_bytes, json_depth, decoded_bytes, decoded_bytes_free, decoded_bytes_per_byte,
         instances, nodes] = limits;
  archive(file_bytes, json_bytes, json_depth, decoded_bytes, decoded_bytes_free, decoded_bytes_per_byte,
          instances, nodes);
}
template <class A>
void fields(A& archive, Is<io::GltfOptions> auto& options) {
  auto& [scene_index, limits] = options;
  archive(scene_index, limits);
}
template <class A>
void fields(A& archive, Is<ImportOrder> auto& order) {
  auto& [options, memory_bytes, output_bytes, cpu_s, parent] = order;
  archive(options, memory_bytes, output_bytes, cpu_s, parent);
}
template <class A>
void fields(A& archive, Is<Outcome> auto& outcome) {
  auto& [done, code, message, where] = outcome;
  archive(done, code, message, where);
}

}  // namespace store

namespace {

using store::ByteReader;
using store::ByteWriter;

constexpr std::size_t kSizeBytes = sizeof(std::uint64_t);
/// Both ends are the same program.
constexpr std::uint32_t kOnlyFormat = 1;

std::string encode_size(std::size_t size) {
  ByteWriter writer(kOnlyFormat);
  writer(std::uint64_t(size));
  return writer.take();
}

/// The piece at the front, taken off; none when there is no whole one.
std::optional<std::string_view> take_piece(std::string_view& bytes) {
  if (bytes.size() < kSizeBytes) return std::nullopt;
  std::uint64_t size = 0;
  ByteReader reader(bytes.substr(0, kSizeBytes));
  reader(size);
  bytes.remove_prefix(kSizeBytes);
  if (size > bytes.size()) return std::nullopt;
  const std::string_view piece = bytes.substr(0, std::size_t(size));
  bytes.remove_prefix(std::size_t(size));
  return piece;
}

template <class T>
std::string encode_one(const T& value) {
  ByteWriter writer(kOnlyFormat);
  writer(value);
  return writer.take();
}

ImportAnswer no_answer() {
  return {false, Error{ErrorCode::kInvalidFile, "it is no answer", ""}};
}

}  // namespace

std::string encode(const ImportOrder& order) {
  const std::string bytes = encode_one(order);
  return encode_size(bytes.size()) + bytes;
}

Result<ImportInput> decode_import(std::string_view bytes) {
  const auto head = take_piece(bytes);
  ImportInput input{{}, bytes};
  if (!head) return Error{ErrorCode::kInvalidFile, "it is no order", ""};
  ByteReader reader(*head);
  reader(input.order);
  if (!reader.ok()) return Error{ErrorCode::kInvalidFile, "it is no order", ""};
  return input;
}

std::vector<std::string> encode_outcome(const Result<scene::SceneData>& outcome) {
  std::vector<std::string> pieces;
  const auto add = [&pieces](std::string piece) {
    pieces.push_back(encode_size(piece.size()));
    pieces.push_back(std::move(piece));
  };
  if (!outcome) {
    add(encode_one(Outcome{false, outcome.error().code, outcome.error().message, outcome.error().where}));
    return pieces;
  }
  add(encode_one(Outcome{true, ErrorCode::kInternal, {}, {}}));
  add(store::encode(*outcome));
  for (const auto& mesh : outcome->meshes) add(store::encode(*mesh));
  return pieces;
}

ImportAnswer decode_outcome(std::string_view bytes) {
  const auto head = take_piece(bytes);
  if (!head) return no_answer();
  Outcome outcome;
  ByteReader reader(*head);
  reader(outcome);
  if (!reader.ok()) return no_answer();
  if (!outcome.done) return {true, Error{outcome.code, std::move(outcome.message), std::move(outcome.where)}};
  const auto data_bytes = take_piece(bytes);
  if (!data_bytes) return no_answer();
  auto data = store::decode_data(*data_bytes);
  if (!data) return no_answer();
  while (!bytes.empty()) {
    const auto piece = take_piece(bytes);
    if (!piece) return no_answer();
    auto mesh = store::decode_mesh(*piece);
    if (!mesh) return no_answer();
    data->meshes.push_back(std::make_shared<const mesh::TriangleMesh>(std::move(mesh).value()));
  }
  if (data->meshes.size() != data->deformations.size()) return no_answer();
  return {true, std::move(data).value()};
}

}  // namespace gridcast::server
