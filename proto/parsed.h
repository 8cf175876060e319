#pragma once

#include <cassert>
#include <utility>
#include <variant>

#include "proto/error_table.h"

namespace gridcast::proto {

/// A valid value or the Problem that the client gets. Like Result, with the wire's codes instead of core's.
template <class T>
class [[nodiscard]] Parsed {
 public:
  // `return value;` and `return problem;` are what this type is for.
  // NOLINTBEGIN(google-explicit-constructor)
  Parsed(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Parsed(Problem problem) : state_(std::in_place_index<1>, std::move(problem)) {}
  // NOLINTEND(google-explicit-constructor)

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
  [[nodiscard]] const Problem& problem() const {
    assert(!ok());
    return *std::get_if<1>(&state_);
  }

  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::variant<T, Problem> state_;
};

}  // namespace gridcast::proto
