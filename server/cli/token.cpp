#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "server/access/token_file.h"
#include "server/cli/common.h"
#include "server/scene_store.h"

namespace gridcast::server {
namespace {

constexpr const char* kFooter = R"(
A token is shown once, at its making; the tokens file keeps its SHA-256 alone. 'gridcast serve --tokens FILE' serves
those who send 'Authorization: Bearer TOKEN' with a token of the file. To take one back delete its line, and send
the server SIGHUP.

The file holds a JSON object a line, and is left to its owner (chmod 600):
  {"name": "lab", "sha256": "64 hexadecimal digits", "role": "write", "scenes": ["arm"], "rays_per_s": 1e6}
  name            shown in the server's log; letters, digits, '_', '.' and '-'
  role            read: looks at scenes and asks; write: changes them too, and creates, copies and deletes scenes when
                  it is not restricted to some; admin: sees and ends the jobs of all tokens too
  scenes          all that the token sees; left out: every scene
  requests_per_s  of this token, on average; more are answered with 429; left out: no limit
  rays_per_s      rays, points, and samples of pictures, likewise

Examples:
  gridcast token new --name lab --role write --scene arm --append tokens
  gridcast token new --name prometheus --role read)";

class TokenCommand final : public Command {
 public:
  explicit TokenCommand(CLI::App& app) : Command(app) {
    app.footer(kFooter);
    app.require_subcommand(1);
    CLI::App* make = app.add_subcommand("new", "Make a token and its line for the tokens file");
    make->add_option("--name", token_.name, "Whose it is")->required();
    make->add_option("--role", role_, "read, write or admin")
        ->required()
        ->check(CLI::IsMember({"read", "write", "admin"}));
    make->add_option("--scene", scenes_, "A scene that it may touch (repeatable); none: every scene");
    make->add_option("--requests-per-s", token_.requests_per_s, "Requests per second, on average")
        ->check(CLI::PositiveNumber);
    make->add_option("--rays-per-s", token_.rays_per_s, "Rays and points per second, on average")
        ->check(CLI::PositiveNumber);
    make->add_option("--append", file_, "Write the line to the end of this file, made when missing");
  }

  int run(const std::stop_token&) override {
    token_.role = role_ == "read"    ? access::Role::kRead
                  : role_ == "write" ? access::Role::kWrite
                                     : access::Role::kAdmin;
    if (!scenes_.empty()) token_.scenes = scenes_;
    const std::string text = access::make_token();
    token_.sha256 = store::sha256(text);
    const std::string line = access::to_line(token_) + "\n";
    // What the server would refuse is not written.
    if (const auto parsed = access::parse_tokens(line); !parsed) {
      std::fprintf(stderr, "gridcast: token:%s\n", parsed.error().message.c_str());
      return kExitUsage;
    }
    if (!file_.empty() && !append(line)) {
      std::perror(("gridcast: " + file_).c_str());
      return kExitFailed;
    }
    std::printf("%s\n", text.c_str());
    if (file_.empty()) std::printf("%s", line.c_str());
    return kExitDone;
  }

 private:
  [[nodiscard]] bool append(const std::string& line) const {
    const int file = ::open(file_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    if (file < 0) return false;
    const bool written = ::write(file, line.data(), line.size()) == ssize_t(line.size());
    return ::close(file) == 0 && written;
  }

  access::Token token_;
  std::string role_;
  std::vector<std::string> scenes_;
  std::string file_;
};

}  // namespace

std::unique_ptr<Command> make_token_command(CLI::App& program) {
  return std::make_unique<TokenCommand>(*program.add_subcommand("token", "Make tokens for gridcast serve"));
}

}  // namespace gridcast::server
