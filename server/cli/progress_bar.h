#pragma once

#include <chrono>
#include <mutex>
#include <string>

#include "core/scene/scene.h"

namespace gridcast::server {

enum class Verbosity { kQuiet, kNormal };

/// "tracing  [=======>      ]  52 %  3 s left": one line of at most `columns` characters.
[[nodiscard]] std::string progress_line(const std::string& label, double fraction, double elapsed_s,
                                        int columns);

/// A bar on stderr, when that is a terminal and the program is not quiet; else nothing at all. Erases itself
/// when it goes.
class ProgressBar {
 public:
  ProgressBar(std::string label, Verbosity verbosity);
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// From any thread; fractions that go back are ignored. Empty when there is no bar to draw.
  [[nodiscard]] scene::ProgressCallback callback();

 private:
  void show(double fraction);

  std::string label_;
  bool visible_;
  int columns_ = 80;
  std::mutex mutex_;
  double shown_ = -1.0;
  std::chrono::steady_clock::time_point started_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point drawn_{};
};

}  // namespace gridcast::server
