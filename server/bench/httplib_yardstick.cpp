#include "server/bench/httplib_yardstick.h"

#include <limits>

#include <httplib.h>

namespace gridcast::server {

struct HttplibYardstick::Library {
  httplib::Server server;
};

HttplibYardstick::HttplibYardstick() : library_(std::make_unique<Library>()) {
  httplib::Server& server = library_->server;
  server.Post("/.*", [](const httplib::Request&, httplib::Response& response) {
    response.set_content(R"({"status":[1]})", "application/json");
  });
  // As ours is set, so that neither pays for what the other does not do.
  server.set_tcp_nodelay(true);
  server.set_keep_alive_max_count(std::numeric_limits<std::size_t>::max());
}

HttplibYardstick::~HttplibYardstick() {
  if (!thread_.joinable()) return;
  library_->server.stop();
  thread_.join();
}

Result<int> HttplibYardstick::start() {
  const int port = library_->server.bind_to_any_port("127.0.0.1");
  if (port <= 0) return Error{ErrorCode::kIo, "cannot listen on 127.0.0.1", "/load"};
  thread_ = std::thread([this] { library_->server.listen_after_bind(); });
  // Before that stop() would do nothing.
  while (!library_->server.is_running()) std::this_thread::yield();
  return port;
}

}  // namespace gridcast::server
