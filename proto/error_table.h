#pragma once
// The one table of everything that can be wrong with a request: stable code, HTTP status, title (RFC 9457).

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/error.h"

namespace gridcast::proto {

enum class ProblemCode : std::uint8_t {
  // the request itself
  kUnauthorized,
  kForbidden,
  kInvalidRequest,
  kInvalidHeader,
  kNotFound,
  kMethodNotAllowed,
  kNotAcceptable,
  kLengthRequired,
  kPayloadTooLarge,
  kUriTooLong,
  kHeadersTooLarge,
  kUnsupportedMediaType,
  kUnsupportedEncoding,
  // its body and its parameters
  kInvalidJson,
  kTooDeep,
  kDuplicateField,
  kUnknownField,
  kUnknownParameter,
  kMissingField,
  kWrongType,
  kWrongLength,
  kOutOfRange,
  kInvalidValue,
  kDuplicateId,
  kIdempotencyKeyReused,
  kTooManyRays,
  kTooManyPoints,
  kInvalidGlb,
  kUnsupportedExtension,
  // the state it meets
  kSceneNotFound,
  kMeshNotFound,
  kInstanceNotFound,
  kJobNotFound,
  kNameTaken,
  kCannotRefit,
  kVersionMismatch,
  kVersionNotFound,
  kVersionGone,
  kLogGone,
  kJobNotDone,
  kJobCancelled,
  // the server
  kLimitExceeded,
  kTooManyScenes,
  kMemoryFull,
  kStorageFull,
  kStorageFailed,
  kSceneDamaged,
  kDrawingUnavailable,
  kTooManyJobs,
  kQuotaExceeded,
  kDeadlineExceeded,
  kCancelled,
  kOverloaded,
  kNotReady,
  kInternal,
};

struct ProblemKind {
  ProblemCode code;
  std::string_view name;  ///< on the wire: invalid_json
  int status;             ///< HTTP
  std::string_view title;
};

/// Every kind, in the order of ProblemCode.
[[nodiscard]] std::span<const ProblemKind> all_problems();
[[nodiscard]] const ProblemKind& describe(ProblemCode code);

/// What is wrong with one request. `detail` is a sentence for people and never repeats the request's bytes;
/// `pointer` is a JSON pointer into the body (`/directions/3`), `?name` for a query parameter, the name of a
/// header, or empty for the body as a whole.
struct Problem {
  ProblemCode code = ProblemCode::kInternal;
  std::string detail;
  std::string pointer;
  int retry_after_s = 1;  ///< of 429 and 503

  [[nodiscard]] int status() const { return describe(code).status; }
};

inline constexpr std::string_view kProblemMediaType = "application/problem+json";

/// {"type", "title", "status", "code", "detail", "pointer"}. Bytes that are not UTF-8 are replaced.
[[nodiscard]] std::string to_json(const Problem& problem);

/// Where an error of core came from; decides what its code means to a client.
enum class ErrorContext : std::uint8_t { kImport, kUpdate, kQuery };

/// kIo and kInternal become `internal` with a fixed detail: nothing of the machine leaks.
[[nodiscard]] Problem to_problem(const Error& error, ErrorContext context);

}  // namespace gridcast::proto
