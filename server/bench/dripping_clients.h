#pragma once

#include <cstddef>
#include <thread>

namespace gridcast::server {

/// Connections that send the head of a request at one byte a second each, as long as it lives ("slow loris").
/// One that the server closes is opened again when its next byte is due. Ready when all are connected.
class DrippingClients {
 public:
  DrippingClients(int port, std::size_t count);

 private:
  std::jthread thread_;
};

}  // namespace gridcast::server
