#include "server/http/admission.h"

#include <utility>

#include "server/http/small_request.h"

namespace gridcast::server {

bool Admission::admit(const Connection& connection, Turn& turn) {
  const auto* request = turn.head ? std::get_if<HttpHead>(&*turn.head) : nullptr;
  if (request != nullptr && !turn.long_place && is_long_request(*request)) {
    if (auto place = long_.try_enter()) turn.long_place.emplace(std::move(*place));
    return turn.long_place.has_value();
  }
  if (turn.place || request == nullptr || !is_heavy_request(*request)) return true;
  if (!connection.has_body(*request)) return !heavy_.is_full();
  if (auto place = heavy_.try_take()) turn.place.emplace(std::move(*place));
  return turn.place.has_value();
}

}  // namespace gridcast::server
