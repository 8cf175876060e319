#pragma once

#include <atomic>
#include <chrono>
#include <functional>

namespace gridcast::server {

/// Between looks at who else has come, where somebody has been refused: to refuse some at a time takes less
/// from those who are served than to interrupt them for each.
inline constexpr std::chrono::milliseconds kRestAfterRefusal{1};

/// Accepts connections until `stopping`, after which whoever sets it shuts `listening` down. `take` gets each
/// socket and owns it; children of this process do not inherit it. It returns whether its request was
/// refused.
void accept_connections(int listening, const std::atomic<bool>& stopping,
                        const std::function<bool(int)>& take);

}  // namespace gridcast::server
