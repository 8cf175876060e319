#pragma once

#include <memory>
#include <string>
#include <utility>

namespace gridcast::scene {

/// A text that does not change and that copies share. One that is empty takes no memory of its own: of a
/// million instances few have a name.
class SharedText {
 public:
  SharedText() = default;
  explicit SharedText(std::string text) { *this = std::move(text); }
  SharedText& operator=(std::string text) {
    text_ = text.empty() ? nullptr : std::make_shared<const std::string>(std::move(text));
    return *this;
  }

  [[nodiscard]] const std::string& str() const {
    static const std::string none;
    return text_ ? *text_ : none;
  }

 private:
  std::shared_ptr<const std::string> text_;
};

}  // namespace gridcast::scene
