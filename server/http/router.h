#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/http_types.h"

namespace gridcast::server {

/// A kind of body that a route takes, and its size limit.
struct AcceptedBody {
  std::string media_type;  ///< essence in lower case
  std::size_t max_bytes = 0;
};

using Handler = std::function<HttpResponse(const HttpRequest&, Cancellation&)>;

/// Whether a handler gets bodies whole, or may have to take large ones while they come
/// (HttpRequest::incoming).
enum class BodyArrival : std::uint8_t { kWhole, kOnTheWay };

struct Route {
  std::string method;  ///< GET also answers HEAD
  /// "/v1/scenes/{s}": a name in braces captures the segment; "{s}:fork" what stands before the end given.
  std::string pattern;
  std::vector<AcceptedBody> accepts;  ///< none: the route takes no body
  Handler handler;
  BodyArrival arrival = BodyArrival::kWhole;
};

/// Finds the route of a request. Patterns are few and short: a linear search is enough.
class Router {
 public:
  void add(Route route);

  struct Match {
    const Route* route = nullptr;                 ///< null: nothing answers to this path and method
    std::map<std::string, std::string> captures;  ///< decoded
    std::string allowed;  ///< methods that the path knows ("GET, HEAD, POST"); empty for an unknown path
  };
  [[nodiscard]] Match match(std::string_view method, std::string_view path) const;

 private:
  struct Entry {
    Route route;
    std::vector<std::string> segments;
  };
  std::vector<Entry> entries_;
};

}  // namespace gridcast::server
