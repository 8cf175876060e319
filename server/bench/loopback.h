#pragma once
// A server and its clients within this process, for measuring what HTTP costs.

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/error.h"
#include "core/scene/scene.h"
#include "server/http/http_server.h"

namespace gridcast::server {

struct Api;

/// Serves one scene, named `bench`, on a free port of the loopback address as long as it lives.
class LoopbackServer {
 public:
  LoopbackServer(std::shared_ptr<const scene::Scene> scene, std::size_t threads,
                 HttpServerOptions options = few_connections());
  ~LoopbackServer();
  LoopbackServer(const LoopbackServer&) = delete;
  LoopbackServer& operator=(const LoopbackServer&) = delete;

  /// The port.
  [[nodiscard]] Result<int> start();
  /// In a batch.
  [[nodiscard]] std::size_t max_rays() const;
  [[nodiscard]] std::size_t requests_in_flight() const { return http_->requests_in_flight(); }

 private:
  static HttpServerOptions few_connections();

  std::unique_ptr<Api> api_;
  bool made_ = false;
  std::unique_ptr<HttpServer> http_;
  std::thread thread_;
};

/// One connection that is kept, and one request at a time. When the server has closed it, after many requests
/// or a while without any, the next request opens another.
class LoopbackClient {
 public:
  explicit LoopbackClient(int port);
  ~LoopbackClient();
  LoopbackClient(const LoopbackClient&) = delete;
  LoopbackClient& operator=(const LoopbackClient&) = delete;

  /// Sends rays, float32 rows of 8, and reads the whole answer, closest hits in binary.
  [[nodiscard]] Status cast(std::span<const std::byte> rays);
  /// Sends rays as cast() does, and does not wait for the answer.
  [[nodiscard]] Status send(std::span<const std::byte> rays);
  /// Closes the connection, whatever is under way.
  void hang_up();
  /// Sends `head`, which lacks its last lines (Content-Length and what follows), and `body`; the whole
  /// answer, which is to be of status 200. The view is good until the next request.
  [[nodiscard]] Result<std::string_view> ask(const std::string& head, std::span<const std::byte> body);
  /// PUT .../pose; the view of the answer's body is good until the next request.
  [[nodiscard]] Result<std::string_view> put_pose(std::string_view json);

 private:
  Status exchange(const std::string& head, std::span<const std::byte> body);
  void connect();
  /// Whether a whole answer came.
  bool exchange_once(const std::string& head, std::span<const std::byte> body);
  bool send_all(const void* data, std::size_t size) const;
  bool read_answer();

  int port_;
  int socket_ = -1;
  bool connected_ = false;
  std::vector<char> answer_;
  std::size_t answered_bytes_ = 0;
};

}  // namespace gridcast::server
