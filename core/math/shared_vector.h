#pragma once

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <utility>
#include <vector>

namespace gridcast {

/// A vector whose copies share their elements until one of them is about to change: copying costs O(1). Any
/// number of threads may read copies, as they may vectors; what gives write access (every member that is not
/// const) takes an own copy of the elements first, so it invalidates iterators.
template <class T>
class SharedVector {
 public:
  using value_type = T;
  using const_iterator = const T*;
  using iterator = T*;

  SharedVector() = default;
  // Implicit, so that a SharedVector is filled and compared like the vector that it stands for.
  // NOLINTBEGIN(google-explicit-constructor)
  SharedVector(std::vector<T> values) : owner_(std::make_shared<std::vector<T>>(std::move(values))) {
    refresh();
  }
  SharedVector(std::initializer_list<T> values) : SharedVector(std::vector<T>(values)) {}
  // NOLINTEND(google-explicit-constructor)

  SharedVector(const SharedVector&) = default;
  SharedVector& operator=(const SharedVector&) = default;
  SharedVector(SharedVector&& other) noexcept
      : owner_(std::move(other.owner_)),
        data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)) {}
  SharedVector& operator=(SharedVector&& other) noexcept {
    owner_ = std::move(other.owner_);
    data_ = std::exchange(other.data_, nullptr);
    size_ = std::exchange(other.size_, 0);
    return *this;
  }
  ~SharedVector() = default;

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] const T& operator[](std::size_t i) const { return data_[i]; }
  [[nodiscard]] const T* data() const { return data_; }
  [[nodiscard]] const T* begin() const { return data_; }
  [[nodiscard]] const T* end() const { return data_ + size_; }
  [[nodiscard]] const T& front() const { return data_[0]; }
  [[nodiscard]] const T& back() const { return data_[size_ - 1]; }

  [[nodiscard]] T& operator[](std::size_t i) { return own()[i]; }
  [[nodiscard]] T* data() { return own().data(); }
  [[nodiscard]] T* begin() { return own().data(); }
  [[nodiscard]] T* end() { return own().data() + size_; }
  [[nodiscard]] T& back() { return own().back(); }

  void push_back(T value) {
    own().push_back(std::move(value));
    refresh();
  }
  void pop_back() {
    own().pop_back();
    refresh();
  }
  void reserve(std::size_t count) {
    own().reserve(count);
    refresh();
  }
  void resize(std::size_t count) {
    own().resize(count);
    refresh();
  }
  void clear() { *this = {}; }

  /// Whether both have the same elements in the same place.
  [[nodiscard]] bool shares_with(const SharedVector& other) const { return data_ == other.data_; }

  friend bool operator==(const SharedVector& a, const SharedVector& b) {
    return a.shares_with(b) ? a.size_ == b.size_ : std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  std::vector<T>& own() {
    if (owner_ == nullptr) {
      owner_ = std::make_shared<std::vector<T>>();
    } else if (owner_.use_count() != 1) {
      owner_ = std::make_shared<std::vector<T>>(*owner_);
    }
    refresh();
    return *owner_;
  }
  void refresh() {
    data_ = owner_->data();
    size_ = owner_->size();
  }

  std::shared_ptr<std::vector<T>> owner_;
  const T* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace gridcast
