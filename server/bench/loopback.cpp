#include "server/bench/loopback.h"

#include <algorithm>
#include <charconv>
#include <utility>
#include <variant>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/routes/api.h"

namespace gridcast::server {
namespace {

constexpr std::size_t kPiece = std::size_t(1) << 16;
constexpr std::string_view kEndOfHead = "\r\n\r\n";

const std::string kCastHead =
    "POST /v1/scenes/bench/rays/closest HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    "Content-Type: application/vnd.gridcast.rays; dtype=float32; columns=8\r\n"
    "Accept: application/vnd.gridcast.hits\r\n";

std::string with_length(const std::string& head, std::size_t body_bytes) {
  return head + "Content-Length: " + std::to_string(body_bytes) + "\r\n\r\n";
}

Error failed(const char* what) {
  return {ErrorCode::kIo, std::string(what) + " failed", "/serve"};
}

/// Of head and body, once the head is there; else 0.
std::size_t whole_size(std::string_view text) {
  const std::size_t end = text.find(kEndOfHead);
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
    return end + kEndOfHead.size() + size;
  }
  return end + kEndOfHead.size();
}

}  // namespace

LoopbackServer::LoopbackServer(std::shared_ptr<const scene::Scene> scene, std::size_t threads,
                               HttpServerOptions options)
    : api_(std::make_unique<Api>(proto::Limits{}, threads)) {
  made_ =
      std::holds_alternative<std::shared_ptr<NamedScene>>(api_->store.create("bench", std::move(scene), {}));
  options.port = 0;
  http_ = std::make_unique<HttpServer>(make_router(*api_), options, [](const RequestRecord&) {});
}

HttpServerOptions LoopbackServer::few_connections() {
  HttpServerOptions options;
  options.connection_threads = 4;
  return options;
}

LoopbackServer::~LoopbackServer() {
  if (!thread_.joinable()) return;
  http_->stop();
  thread_.join();
}

Result<int> LoopbackServer::start() {
  if (!made_) return failed("naming the scene");
  Result<int> port = http_->bind();
  if (port) thread_ = std::thread([this] { http_->serve(); });
  return port;
}

std::size_t LoopbackServer::max_rays() const {
  return api_->limits.binary_rays;
}

LoopbackClient::LoopbackClient(int port) : port_(port) {
  connect();
}

LoopbackClient::~LoopbackClient() {
  if (socket_ >= 0) ::close(socket_);
}

void LoopbackClient::connect() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(std::uint16_t(port_));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  const int one = 1;
  ::setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
}

Status LoopbackClient::cast(std::span<const std::byte> rays) {
  return exchange(kCastHead, rays);
}

Status LoopbackClient::send(std::span<const std::byte> rays) {
  if (!connected_) return failed("connecting");
  const std::string head = with_length(kCastHead, rays.size());
  if (!send_all(head.data(), head.size()) || !send_all(rays.data(), rays.size())) return failed("sending");
  return ok_status();
}

void LoopbackClient::hang_up() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  connected_ = false;
}

Result<std::string_view> LoopbackClient::ask(const std::string& head, std::span<const std::byte> body) {
  if (const Status status = exchange(head, body); !status) return status.error();
  return std::string_view(answer_.data(), answered_bytes_);
}

Result<std::string_view> LoopbackClient::put_pose(std::string_view json) {
  const auto answer =
      ask("PUT /v1/scenes/bench/pose HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n",
          std::as_bytes(std::span(json)));
  if (!answer) return answer.error();
  return answer->substr(answer->find(kEndOfHead) + kEndOfHead.size());
}

Status LoopbackClient::exchange(const std::string& head, std::span<const std::byte> body) {
  const std::string whole = with_length(head, body.size());
  bool answered = exchange_once(whole, body);
  if (!answered) {
    connect();
    answered = exchange_once(whole, body);
  }
  if (!connected_) return failed("connecting");
  if (!answered) return failed("the exchange");
  if (!std::string_view(answer_.data(), answered_bytes_).starts_with("HTTP/1.1 200"))
    return failed("the request");
  return ok_status();
}

bool LoopbackClient::exchange_once(const std::string& head, std::span<const std::byte> body) {
  return connected_ && send_all(head.data(), head.size()) && send_all(body.data(), body.size()) &&
         read_answer();
}

bool LoopbackClient::send_all(const void* data, std::size_t size) const {
  const auto* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t sent = ::send(socket_, at, size, MSG_NOSIGNAL);
    if (sent <= 0) return false;
    at += sent;
    size -= std::size_t(sent);
  }
  return true;
}

bool LoopbackClient::read_answer() {
  std::size_t have = 0, wanted = 0;
  while (wanted == 0 || have < wanted) {
    if (answer_.size() < std::max(wanted, have + kPiece)) answer_.resize(std::max(wanted, have + kPiece));
    const ssize_t got = ::recv(socket_, answer_.data() + have, answer_.size() - have, 0);
    if (got <= 0) return false;
    have += std::size_t(got);
    if (wanted == 0) wanted = whole_size(std::string_view(answer_.data(), have));
  }
  answered_bytes_ = have;
  return true;
}

}  // namespace gridcast::server
