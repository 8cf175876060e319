#include "server/machine.h"

#include <fstream>
#include <string>
#include <thread>

#include "core/measure/embree_yardstick.h"
#include "server/instruction_set.h"

namespace gridcast::server {
namespace {

using Json = nlohmann::ordered_json;

std::string cpu_name() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    const std::size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) return line.substr(colon + 2);
  }
  return "unknown";
}

/// Of the sets that our kernels choose from at run time, those that this CPU has.
Json cpu_instruction_sets() {
  Json sets = Json::array();
#if defined(__x86_64__)
  if (__builtin_cpu_supports("sse4.2") != 0) sets.push_back("sse4.2");
  if (__builtin_cpu_supports("avx2") != 0) sets.push_back("avx2");
  if (__builtin_cpu_supports("avx512f") != 0) sets.push_back("avx512");
#elif defined(__ARM_NEON)
  sets.push_back("neon");
#endif
  return sets;
}

}  // namespace

Json machine_json() {
  const measure::EmbreeInfo embree = measure::embree_info();
  return {{"cpu", cpu_name()},
          {"threads", std::thread::hardware_concurrency()},
          {"cpu_isa", cpu_instruction_sets()},
          {"compiled_isa", instruction_set()},
          {"compiler", __VERSION__},
          {"gridcast", GRIDCAST_VERSION},
          {"embree",
           {{"version", embree.version},
            {"headers", embree.headers},
            {"tasking", embree.tasking},
            {"assertions", embree.assertions},
            {"native_packet8", embree.native_packet8},
            {"native_packet16", embree.native_packet16}}}};
}

}  // namespace gridcast::server
