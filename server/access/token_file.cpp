#include "server/access/token_file.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>

#include <sys/stat.h>

#include "proto/geometry_reader.h"
#include "proto/scene_request.h"

namespace gridcast::server::access {
namespace {

using proto::JsonNode;
using proto::ProblemCode;

constexpr std::array<std::string_view, 3> kRoleNames{"read", "write", "admin"};
constexpr std::size_t kMaxFileBytes = std::size_t(4) << 20;

std::string read_scene_name(const JsonNode& node) {
  std::string name = proto::read_name(node, proto::kMaxSceneNameBytes);
  if (!proto::is_scene_name(name))
    node.fail(ProblemCode::kInvalidValue, "must be 1 to 64 letters, digits, '_', '.' or '-'");
  return name;
}

std::vector<std::string> read_scenes(const JsonNode& node) {
  std::vector<std::string> scenes;
  const auto array = proto::read_array(node);
  if (!array) return scenes;
  for (const simdjson::dom::element element : *array)
    scenes.push_back(read_scene_name(node.child(element, scenes.size())));
  if (scenes.empty()) node.fail(ProblemCode::kWrongLength, "must name a scene; leave it out for all scenes");
  return scenes;
}

store::Digest read_digest(const JsonNode& node) {
  const auto digest = store::parse_hex(proto::read_name(node, 64));
  if (!digest) node.fail(ProblemCode::kInvalidValue, "must be 64 digits 0-9, a-f");
  return digest.value_or(store::Digest{});
}

Token read_token(const JsonNode& root) {
  Token token;
  const proto::ObjectReader object(root,
                                   {"name", "sha256", "role", "scenes", "requests_per_s", "rays_per_s"});
  if (root.problems->any()) return token;
  if (const JsonNode* name = object.require("name")) token.name = read_scene_name(*name);
  if (const JsonNode* digest = object.require("sha256")) token.sha256 = read_digest(*digest);
  if (const JsonNode* role = object.require("role"))
    token.role =
        Role(std::ranges::find(kRoleNames, proto::read_choice(*role, kRoleNames)) - kRoleNames.begin());
  if (const JsonNode* scenes = object.find("scenes")) {
    token.scenes = read_scenes(*scenes);
    if (token.role == Role::kAdmin)
      scenes->fail(ProblemCode::kInvalidValue, "an admin is not restricted to scenes");
  }
  if (const JsonNode* rate = object.find("requests_per_s"))
    token.requests_per_s = proto::read_number_above(*rate, 0.0, 1e12);
  if (const JsonNode* rate = object.find("rays_per_s"))
    token.rays_per_s = proto::read_number_above(*rate, 0.0, 1e15);
  return token;
}

Error at_line(std::size_t number, const std::string& what) {
  return {ErrorCode::kInvalidArgument, what, "line " + std::to_string(number)};
}

/// Where it may be told apart from those before it, nothing.
std::optional<std::string> find_repeated(const std::vector<Token>& tokens, const Token& token) {
  for (const Token& other : tokens) {
    if (other.name == token.name) return "the name is taken by a line before";
    if (other.sha256 == token.sha256) return "the token is that of a line before";
  }
  return std::nullopt;
}

}  // namespace

Result<std::vector<Token>> parse_tokens(std::string_view text) {
  std::vector<Token> tokens;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty() || line[0] == '#') continue;
    auto token = proto::parse_body(line, proto::Limits{}, read_token);
    if (!token) return at_line(number, token.problem().pointer + " " + token.problem().detail);
    if (const auto repeated = find_repeated(tokens, *token)) return at_line(number, *repeated);
    tokens.push_back(*std::move(token));
  }
  return tokens;
}

Result<std::vector<Token>> read_tokens(const std::string& path) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "re"), &std::fclose);
  struct stat status {};
  if (!file || ::fstat(::fileno(file.get()), &status) != 0 || !S_ISREG(status.st_mode))
    return Error{ErrorCode::kIo, "the tokens file cannot be read", path};
  if ((status.st_mode & (S_IWGRP | S_IRWXO)) != 0)
    return Error{ErrorCode::kIo, "others may read or write the tokens file; chmod 600 leaves it to its owner",
                 path};
  std::string text(kMaxFileBytes + 1, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), file.get()));
  if (std::ferror(file.get()) != 0 || text.size() > kMaxFileBytes)
    return Error{ErrorCode::kIo, "the tokens file cannot be read, or has more than 4 MiB", path};
  auto tokens = parse_tokens(text);
  if (!tokens) return Error{ErrorCode::kIo, tokens.error().message, path + " " + tokens.error().where};
  return tokens;
}

}  // namespace gridcast::server::access
