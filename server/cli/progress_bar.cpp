#include "server/cli/progress_bar.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <sys/ioctl.h>
#include <unistd.h>

namespace gridcast::server {
namespace {

constexpr std::chrono::milliseconds kRedraw{50};
// Work that ends sooner than this shows no bar: it would only flicker.
constexpr std::chrono::milliseconds kPatience{200};

std::string duration_text(double seconds) {
  char text[32];
  const long whole = std::lround(seconds);
  if (whole < 60)
    std::snprintf(text, sizeof(text), "%ld s", whole);
  else
    std::snprintf(text, sizeof(text), "%ld min %02ld s", whole / 60, whole % 60);
  return text;
}

int terminal_columns() {
  winsize size{};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? int(size.ws_col) : 80;
}

}  // namespace

std::string progress_line(const std::string& label, double fraction, double elapsed_s, int columns) {
  fraction = std::clamp(fraction, 0.0, 1.0);
  char percent[16];
  std::snprintf(percent, sizeof(percent), " %3d %%", int(std::floor(100.0 * fraction)));
  std::string tail = percent;
  // An estimate from the first few percent would jump about.
  if (fraction >= 0.05 && fraction < 1.0)
    tail.append("  ").append(duration_text(elapsed_s * (1.0 - fraction) / fraction)).append(" left");
  const int room = columns - int(label.size()) - int(tail.size()) - 5;
  std::string line = label;
  if (room >= 5) {
    const int width = std::min(room, 40);
    const int done = int(std::floor(double(width) * fraction));
    line.append(" [").append(std::size_t(done), '=');
    if (done < width) line.append(">").append(std::size_t(width - done - 1), ' ');
    line.append("]");
  }
  line += tail;
  return line.substr(0, std::size_t(std::max(columns - 1, 1)));
}

ProgressBar::ProgressBar(std::string label, Verbosity verbosity)
    : label_(std::move(label)), visible_(verbosity == Verbosity::kNormal && ::isatty(STDERR_FILENO) == 1) {
  if (visible_) columns_ = terminal_columns();
}

ProgressBar::~ProgressBar() {
  if (shown_ >= 0.0) std::fputs("\r\x1b[K", stderr);
}

scene::ProgressCallback ProgressBar::callback() {
  if (!visible_) return {};
  return [this](double fraction) { show(fraction); };
}

void ProgressBar::show(double fraction) {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock() || fraction <= shown_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - started_ < kPatience || now - drawn_ < kRedraw) return;
  drawn_ = now;
  shown_ = fraction;
  const double elapsed_s = std::chrono::duration<double>(now - started_).count();
  std::fprintf(stderr, "\r\x1b[K%s", progress_line(label_, fraction, elapsed_s, columns_).c_str());
}

}  // namespace gridcast::server
