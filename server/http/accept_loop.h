#pragma once

#include <atomic>
#include <functional>

namespace gridcast::server {

/// Accepts connections until `stopping`, after which whoever sets it shuts `listening` down. `take` gets each
/// socket and owns it; children of this process do not inherit it.
void accept_connections(int listening, const std::atomic<bool>& stopping,
                        const std::function<void(int)>& take);

}  // namespace gridcast::server
