#include "server/bench_serve.h"

#include <charconv>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/measure/interleave.h"
#include "core/scene/trace.h"
#include "server/api.h"
#include "server/http_server.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

Error failed(const char* what) {
  return {ErrorCode::kIo, std::string(what) + " failed", "/serve"};
}

/// One connection that is kept, and one request at a time.
class Caller {
 public:
  explicit Caller(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    const int one = 1;
    ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
  }
  ~Caller() { ::close(socket_); }
  Caller(const Caller&) = delete;
  Caller& operator=(const Caller&) = delete;

  /// Sends the rays and reads the whole answer.
  Status cast(std::span<const std::byte> rays) {
    if (!connected_) return failed("connecting");
    const std::string head =
        "POST /v1/scenes/bench/rays/closest HTTP/1.1\r\nHost: 127.0.0.1\r\n"
        "Content-Type: application/vnd.gridcast.rays; dtype=float32; columns=8\r\n"
        "Accept: application/vnd.gridcast.hits\r\nContent-Length: " +
        std::to_string(rays.size()) + "\r\n\r\n";
    if (!send_all(head.data(), head.size()) || !send_all(rays.data(), rays.size())) return failed("sending");
    return read_answer();
  }

 private:
  bool send_all(const void* data, std::size_t size) {
    const auto* at = static_cast<const char*>(data);
    while (size > 0) {
      const ssize_t sent = ::send(socket_, at, size, MSG_NOSIGNAL);
      if (sent <= 0) return false;
      at += sent;
      size -= std::size_t(sent);
    }
    return true;
  }

  Status read_answer() {
    std::size_t have = 0, wanted = 0;
    while (wanted == 0 || have < wanted) {
      if (answer_.size() < std::max(wanted, have + kPiece)) answer_.resize(std::max(wanted, have + kPiece));
      const ssize_t got = ::recv(socket_, answer_.data() + have, answer_.size() - have, 0);
      if (got <= 0) return failed("receiving");
      have += std::size_t(got);
      if (wanted == 0) wanted = whole_size(std::string_view(answer_.data(), have));
    }
    if (!std::string_view(answer_.data(), have).starts_with("HTTP/1.1 200")) return failed("the request");
    return ok_status();
  }

  /// Of head and body, once the head is there; else 0.
  static std::size_t whole_size(std::string_view text) {
    const std::size_t end = text.find("\r\n\r\n");
    if (end == std::string_view::npos) return 0;
    constexpr std::string_view kLength = "content-length:";
    for (std::size_t at = text.find("\r\n"); at < end; at = text.find("\r\n", at + 2)) {
      std::string name(text.substr(at + 2, kLength.size()));
      for (char& c : name) c = char(c >= 'A' && c <= 'Z' ? c + 32 : c);
      if (name != kLength) continue;
      std::size_t digits = at + 2 + kLength.size();
      while (text[digits] == ' ') ++digits;
      std::size_t size = 0;
      std::from_chars(text.data() + digits, text.data() + end, size);
      return end + 4 + size;
    }
    return end + 4;
  }

  static constexpr std::size_t kPiece = std::size_t(1) << 16;
  int socket_;
  bool connected_ = false;
  std::vector<char> answer_;
};

/// The server of this program on a free port, as long as it lives.
class LocalServer {
 public:
  LocalServer(std::shared_ptr<const scene::Scene> scene, std::size_t threads) : api_({}, threads) {
    made_ =
        std::holds_alternative<std::shared_ptr<NamedScene>>(api_.store.create("bench", std::move(scene), {}));
    HttpServerOptions options;
    options.port = 0;
    options.connection_threads = 4;
    http_ = std::make_unique<HttpServer>(make_router(api_), options, [](const RequestRecord&) {});
  }
  ~LocalServer() {
    if (!thread_.joinable()) return;
    http_->stop();
    thread_.join();
  }
  LocalServer(const LocalServer&) = delete;
  LocalServer& operator=(const LocalServer&) = delete;

  [[nodiscard]] Result<int> start() {
    if (!made_) return failed("naming the scene");
    Result<int> port = http_->bind();
    if (port) thread_ = std::thread([this] { http_->serve(); });
    return port;
  }
  [[nodiscard]] std::size_t max_rays() const { return api_.limits.binary_rays; }

 private:
  Api api_;
  bool made_ = false;
  std::unique_ptr<HttpServer> http_;
  std::thread thread_;
};

Status serve_set(const measure::BenchScene& bench_scene, const std::shared_ptr<const scene::Scene>& scene,
                 const measure::RaySet& rays, std::size_t threads, const measure::BenchOptions& options,
                 measure::Report& report, const scene::ProgressCallback& progress) {
  // The server's own threads trace, so the bound has to hold for the whole process.
  const ThreadLimit limit(threads);
  LocalServer server(scene, threads);
  const Result<int> port = server.start();
  if (!port) return port.error();
  if (rays.size() > server.max_rays()) return failed("a batch beyond the server's limit");
  Caller caller(*port);
  std::vector<measure::Timed> timed(2);
  timed[0].run = [&] { return caller.cast(rays.batch().bytes); };
  timed[1].run = [&] {
    const auto hits =
        scene::intersect(*scene, rays.batch(), {Precision::kRobust, HitField::kAll, options.stop, {}});
    return hits ? ok_status() : Status(hits.error());
  };
  if (Status status = interleave(timed, threads, measure::ClockKind::kWall, options, progress); !status)
    return status;
  measure::ServeRow row;
  row.scene = bench_scene.name;
  row.set = measure::to_string(rays.kind);
  row.threads = threads;
  row.rays = rays.size();
  row.mrays_per_s = double(rays.size()) / measure::median(timed[0].seconds) / 1e6;
  row.spread = measure::spread(timed[0].seconds);
  row.vs_in_process = measure::speedup(timed[0].seconds, timed[1].seconds);
  report.serve.push_back(row);
  return ok_status();
}

}  // namespace

Status bench_serve(const measure::BenchScene& bench_scene, const measure::BenchOptions& options,
                   measure::Report& report, const scene::ProgressCallback& progress) {
  const auto scene = scene::build_scene(bench_scene.data, {{}, options.stop, {}});
  if (!scene) return scene.error();
  const measure::RaySetMaker maker(**scene, bench_scene.view, options.rays, options.seed);
  for (const measure::RaySetKind kind : options.sets) {
    if (measure::query_of(kind) != measure::QueryKind::kClosest) continue;
    const auto rays = maker.make(kind);
    if (!rays) return rays.error();
    for (const std::size_t threads : options.threads) {
      if (Status status = serve_set(bench_scene, *scene, *rays, threads, options, report, progress); !status)
        return status;
    }
  }
  return ok_status();
}

}  // namespace gridcast::server
