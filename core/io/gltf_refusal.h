#pragma once
// Inside the importer a document is refused by throwing; gltf.cpp turns that into an Error, so nothing
// is thrown across the folder's interface. A hundred small checks then read as a hundred lines.

#include <cstddef>
#include <exception>
#include <string>
#include <utility>

#include "core/error.h"

namespace gridcast::io {

class Refusal : public std::exception {
 public:
  explicit Refusal(Error error) : error_(std::move(error)) {}
  [[nodiscard]] const char* what() const noexcept override { return error_.message.c_str(); }
  [[nodiscard]] const Error& error() const { return error_; }

 private:
  Error error_;
};

[[noreturn]] inline void refuse(ErrorCode code, std::string message, std::string where = {}) {
  throw Refusal({code, std::move(message), std::move(where)});
}
[[noreturn]] inline void refuse_invalid(std::string message, std::string where = {}) {
  refuse(ErrorCode::kInvalidFile, std::move(message), std::move(where));
}

/// "/accessors/3": the JSON pointer of an element of a top-level array.
inline std::string pointer(const char* collection, std::size_t index) {
  return std::string("/") + collection + "/" + std::to_string(index);
}

/// What may still be decoded. Every array is paid for before it is allocated, as often as it is decoded, so a
/// small file that names one accessor a thousand times is bounded too.
class Budget {
 public:
  explicit Budget(std::size_t bytes) : left_(bytes) {}
  void take(std::size_t count, std::size_t bytes_each, const std::string& where) {
    if (bytes_each != 0 && count > left_ / bytes_each)
      refuse(ErrorCode::kLimitExceeded, "the decoded data would pass the limit on memory", where);
    left_ -= count * bytes_each;
  }

 private:
  std::size_t left_;
};

}  // namespace gridcast::io
