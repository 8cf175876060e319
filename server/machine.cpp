#include "server/machine.h"

#include <fstream>
#include <string>
#include <thread>

#include "core/math/instruction_set.h"
#include "core/measure/embree_yardstick.h"

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

}  // namespace

Json machine_json() {
  const measure::EmbreeInfo embree = measure::embree_info();
  return {{"cpu", cpu_name()},
          {"threads", std::thread::hardware_concurrency()},
          {"cpu_isa", instruction_sets()},
          {"isa", instruction_set()},
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
