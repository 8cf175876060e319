#include "server/bench/cores_apart.h"

#include <charconv>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include <sched.h>

namespace gridcast::server {

struct CoresApart::Sets {
  cpu_set_t all{}, server{}, client{};
};

namespace {

void give_all_threads(const cpu_set_t& cores) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    const std::string name = entry.path().filename().string();
    pid_t thread = 0;
    std::from_chars(name.data(), name.data() + name.size(), thread);
    // One that ends meanwhile needs none.
    ::sched_setaffinity(thread, sizeof(cores), &cores);
  }
}

}  // namespace

Result<std::unique_ptr<CoresApart>> CoresApart::make(std::size_t server_cores) {
  auto sets = std::make_unique<Sets>();
  if (::sched_getaffinity(0, sizeof(sets->all), &sets->all) != 0)
    return Error{ErrorCode::kUnsupported, "the cores of this process are not known", "/clients"};
  std::size_t taken = 0;
  for (int core = 0; core < CPU_SETSIZE && taken <= server_cores; ++core) {
    if (!CPU_ISSET(core, &sets->all)) continue;
    CPU_SET(core, taken < server_cores ? &sets->server : &sets->client);
    ++taken;
  }
  if (taken <= server_cores)
    return Error{ErrorCode::kUnsupported,
                 "clients apart need a core beside the server's " + std::to_string(server_cores), "/clients"};
  return std::unique_ptr<CoresApart>(new CoresApart(std::move(sets)));
}

CoresApart::CoresApart(std::unique_ptr<Sets> sets) : sets_(std::move(sets)) {
  give_all_threads(sets_->server);
}

CoresApart::~CoresApart() {
  give_all_threads(sets_->all);
}

void CoresApart::be_client() const {
  ::sched_setaffinity(0, sizeof(sets_->client), &sets_->client);
}

void CoresApart::be_server() const {
  ::sched_setaffinity(0, sizeof(sets_->server), &sets_->server);
}

}  // namespace gridcast::server
