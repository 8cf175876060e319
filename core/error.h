#pragma once
// Errors as values: core never throws across its interface, never prints, never exits.

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace gridcast {

enum class ErrorCode {
  kInvalidArgument,  ///< a value outside its documented range
  kInvalidFile,      ///< a file or body that breaks its format's rules
  kUnsupported,      ///< well formed, but needs a feature that is not here
  kNotFound,         ///< an id or a file that does not exist
  kConflict,         ///< the state does not allow it (version mismatch, name taken)
  kLimitExceeded,    ///< a documented limit would be passed
  kCancelled,        ///< stopped on request; nothing was changed
  kIo,               ///< reading or writing failed
  kInternal,         ///< a bug of ours
};

/// What went wrong and where. `message` is a sentence for people, `where` names the offending
/// element as a pointer (`/meshes/3/primitives/0/indices`, `/rays/7/direction`) or is empty.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;
  std::string where;
};

/// A value or an Error. Reading the wrong one is a programming error (asserted).
template <class T>
class [[nodiscard]] Result {
 public:
  // Implicit on purpose: `return value;` and `return error;`.
  // NOLINTNEXTLINE(google-explicit-constructor)
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  // NOLINTNEXTLINE(google-explicit-constructor)
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  [[nodiscard]] T& value() & {
    assert(ok());
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] const T& value() const& {
    assert(ok());
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] T&& value() && {
    assert(ok());
    return std::move(*std::get_if<0>(&state_));
  }
  [[nodiscard]] const Error& error() const {
    assert(!ok());
    return *std::get_if<1>(&state_);
  }

  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::variant<T, Error> state_;
};

/// Success without a value, or an Error.
using Status = Result<std::monostate>;
inline Status ok_status() {
  return std::monostate{};
}

}  // namespace gridcast
