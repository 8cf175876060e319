#pragma once

#include <string>
#include <string_view>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

namespace gridcast::server {

/// A client that sends bytes as they are.
class Client {
 public:
  /// From address 127.0.0.`from`.
  explicit Client(int port, unsigned from = 1) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{}, own{};
    address.sin_family = own.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    own.sin_addr.s_addr = htonl(INADDR_LOOPBACK - 1 + from);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)), 0);
    const timeval longest{20, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &longest, sizeof(longest));
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  [[nodiscard]] bool try_send(const std::string& text) const {
    return ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) == ssize_t(text.size());
  }
  Client& send(const std::string& text) {
    EXPECT_EQ(::send(socket_, text.data(), text.size(), MSG_NOSIGNAL), ssize_t(text.size()));
    return *this;
  }
  /// The next answer, which tells its length.
  std::string read_answer() {
    constexpr std::string_view kLength = "Content-Length: ";
    std::string text;
    std::size_t whole = std::string::npos;
    char letter = 0;
    while (text.size() < whole && ::recv(socket_, &letter, 1, 0) == 1) {
      text += letter;
      if (whole == std::string::npos && text.ends_with("\r\n\r\n"))
        whole = text.size() + std::stoul(text.substr(text.find(kLength) + kLength.size()));
    }
    return text;
  }
  /// Everything until the server closes; "cut" at its end when it does so with a reset, or says nothing.
  std::string read_all() {
    std::string text;
    char piece[4096];
    ssize_t n = 0;
    while ((n = ::recv(socket_, piece, sizeof(piece), 0)) > 0) text.append(piece, std::size_t(n));
    return n < 0 ? text + "cut" : text;
  }

 private:
  int socket_;
};

inline std::string get(const std::string& path, const std::string& more = "Connection: close\r\n") {
  return "GET " + path + " HTTP/1.1\r\nHost: x\r\n" + more + "\r\n";
}
inline bool has(const std::string& answer, const std::string& part) {
  return answer.find(part) != std::string::npos;
}
/// The whole answer to `text`.
inline std::string ask(int port, const std::string& text) {
  return Client(port).send(text).read_all();
}

}  // namespace gridcast::server
