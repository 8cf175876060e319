#pragma once

#include <memory>
#include <thread>

#include "core/error.h"

namespace gridcast::server {

/// The HTTP library as it comes, with one handler that answers a constant to any POST: what a request costs
/// before anything of ours begins. On a free port of the loopback address as long as it lives.
class HttplibYardstick {
 public:
  HttplibYardstick();
  ~HttplibYardstick();
  HttplibYardstick(const HttplibYardstick&) = delete;
  HttplibYardstick& operator=(const HttplibYardstick&) = delete;

  /// The port.
  [[nodiscard]] Result<int> start();

 private:
  struct Library;
  std::unique_ptr<Library> library_;
  std::thread thread_;
};

}  // namespace gridcast::server
