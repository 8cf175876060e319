// The process that parses models: what comes back, and what becomes of helpers that fail in every way.

#include "server/import/import_helper.h"

#include <cerrno>
#include <chrono>
#include <thread>

#include <gtest/gtest.h>
#include <sys/wait.h>

#include "server/child_process.h"
#include "server/import/import_order.h"
#include "server/store/scene_codec.h"
#include "tests/support/puppet.h"

namespace gridcast::server {
namespace {

std::string joined(const std::vector<std::string>& pieces) {
  std::string all;
  for (const std::string& piece : pieces) all += piece;
  return all;
}

TEST(ImportOrder, comes_out_as_it_went_in) {
  ImportOrder order;
  order.options.scene_index = 3;
  order.options.limits.json_depth = 17;
  order.memory_bytes = 1;
  order.output_bytes = 2;
  order.cpu_s = 4;
  order.parent = 5;
  const std::string bytes = encode(order) + "model";
  const auto input = decode_import(bytes);
  ASSERT_TRUE(input.ok());
  EXPECT_EQ(input->model, "model");
  EXPECT_EQ(input->order.options.scene_index, 3U);
  EXPECT_EQ(input->order.options.limits.json_depth, 17U);
  EXPECT_EQ(input->order.memory_bytes, 1U);
  EXPECT_EQ(input->order.output_bytes, 2U);
  EXPECT_EQ(input->order.cpu_s, 4U);
  EXPECT_EQ(input->order.parent, 5U);
  for (std::size_t size = 0; size + 5 < bytes.size(); ++size)
    EXPECT_FALSE(decode_import(std::string_view(bytes).substr(0, size)).ok());
}

TEST(ImportOutcome, a_scene_comes_out_as_it_went_in_and_no_part_of_it_does) {
  const scene::SceneData data = test::puppet();
  const std::string bytes = joined(encode_outcome(data));
  const ImportAnswer answer = decode_outcome(bytes);
  ASSERT_TRUE(answer.understood && answer.outcome.ok());
  EXPECT_EQ(store::encode(*answer.outcome), store::encode(data));
  ASSERT_EQ(answer.outcome->meshes.size(), data.meshes.size());
  for (std::size_t i = 0; i < data.meshes.size(); ++i)
    EXPECT_EQ(store::encode(*answer.outcome->meshes[i]), store::encode(*data.meshes[i]));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    ASSERT_FALSE(decode_outcome(std::string_view(bytes).substr(0, size)).understood) << size;
  EXPECT_FALSE(decode_outcome(bytes + "more").understood);
}

TEST(ImportOutcome, an_error_comes_out_with_its_place) {
  const Error error{ErrorCode::kUnsupported, "needs what is not here", "/extensionsRequired/0"};
  const ImportAnswer answer = decode_outcome(joined(encode_outcome(error)));
  ASSERT_TRUE(answer.understood);
  EXPECT_EQ(answer.outcome.error().code, error.code);
  EXPECT_EQ(answer.outcome.error().message, error.message);
  EXPECT_EQ(answer.outcome.error().where, error.where);
}

Result<scene::SceneData> imported(std::vector<std::string> command, const std::stop_token& stop = {}) {
  const std::byte model[4]{};
  return ImportHelper(std::move(command)).import(model, {}, {}, stop);
}

bool has_children() {
  return ::waitpid(-1, nullptr, WNOHANG) != -1 || errno != ECHILD;
}

TEST(ImportHelper, helpers_that_fail_make_the_model_unreadable) {
  const std::vector<std::vector<std::string>> commands{
      {"/bin/false"},
      {"/bin/true"},
      {"/bin/sh", "-c", "kill -SEGV $$"},
      {"/bin/sh", "-c", "kill -SYS $$"},
      {"/bin/echo", "a scene, believe me"},
      {"/usr/bin/truncate", "-s", "9G", "/proc/self/fd/1"},
  };
  for (const auto& command : commands) {
    SCOPED_TRACE(command.back());
    const auto outcome = imported(command);
    ASSERT_FALSE(outcome.ok());
    EXPECT_EQ(outcome.error().code, ErrorCode::kInvalidFile);
    EXPECT_FALSE(has_children());
  }
}

TEST(ImportHelper, one_that_the_system_ends_or_that_cannot_start_had_no_memory) {
  const std::vector<std::vector<std::string>> commands{
      {"/bin/sh", "-c", "kill -KILL $$"}, {"/bin/sh", "-c", "exit 4"}, {"/nowhere/gridcast"}};
  for (const auto& command : commands) {
    SCOPED_TRACE(command.back());
    EXPECT_EQ(imported(command).error().code, ErrorCode::kLimitExceeded);
    EXPECT_FALSE(has_children());
  }
}

TEST(ImportHelper, one_that_hangs_is_ended_on_a_stop) {
  std::stop_source stop;
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    stop.request_stop();
  });
  EXPECT_EQ(imported({"/bin/sleep", "1000"}, stop.get_token()).error().code, ErrorCode::kCancelled);
  stopper.join();
  EXPECT_FALSE(has_children());
  EXPECT_EQ(imported({"/bin/sleep", "1000"}, stop.get_token()).error().code, ErrorCode::kCancelled);
}

TEST(ImportHelper, a_model_beyond_the_limit_starts_nothing) {
  io::GltfOptions options;
  options.limits.file_bytes = 3;
  const std::byte model[4]{};
  EXPECT_EQ(ImportHelper({"/bin/sh", "-c", "exit 1"}).import(model, options, {}, {}).error().code,
            ErrorCode::kLimitExceeded);
}

std::string said_by(std::vector<std::string> command) {
  const MemoryFile in("in"), out("out"), messages("messages");
  const auto end = run_child({std::move(command), {"ONLY=this"}, in, out, messages}, {});
  EXPECT_TRUE(end.ok() && end->went_well());
  const auto bytes = out.read_all();
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

TEST(ChildProcess, gets_three_descriptors_the_environment_it_is_given_and_no_signal_blocked_or_ignored) {
  const MemoryFile open_here("another");
  // Its fourth is the folder that it lists.
  EXPECT_EQ(said_by({"/bin/ls", "/proc/self/fd"}), "0\n1\n2\n3\n");
  EXPECT_EQ(said_by({"/usr/bin/env"}), "ONLY=this\n");
  const std::string status = said_by({"/bin/cat", "/proc/self/status"});
  for (const std::string mask : {"SigBlk:\t", "SigIgn:\t"}) {
    const std::size_t at = status.find(mask);
    ASSERT_NE(at, std::string::npos);
    // Beyond signal 31 are those of the C library.
    EXPECT_EQ(std::stoull(status.substr(at + mask.size(), 16), nullptr, 16) & 0x7FFFFFFFU, 0U) << mask;
  }
}

}  // namespace
}  // namespace gridcast::server
