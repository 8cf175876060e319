#include "proto/error_table.h"

#include <array>

#include "proto/replies_json.h"

namespace gridcast::proto {
namespace {

using enum ProblemCode;

constexpr std::array kProblems{
    ProblemKind{kUnauthorized, "unauthorized", 401, "A valid token is required"},
    ProblemKind{kForbidden, "forbidden", 403, "The token does not allow this"},
    ProblemKind{kInvalidRequest, "invalid_request", 400, "The request breaks HTTP's rules"},
    ProblemKind{kInvalidHeader, "invalid_header", 400, "A header breaks its grammar"},
    ProblemKind{kNotFound, "not_found", 404, "There is no such resource"},
    ProblemKind{kMethodNotAllowed, "method_not_allowed", 405, "The resource does not know this method"},
    ProblemKind{kNotAcceptable, "not_acceptable", 406, "No format that the client accepts is on offer"},
    ProblemKind{kLengthRequired, "length_required", 411, "The body needs a Content-Length"},
    ProblemKind{kPayloadTooLarge, "payload_too_large", 413, "The body is larger than the limit"},
    ProblemKind{kUriTooLong, "uri_too_long", 414, "The URI is too long"},
    ProblemKind{kHeadersTooLarge, "headers_too_large", 431, "The headers are too large"},
    ProblemKind{kUnsupportedMediaType, "unsupported_media_type", 415,
                "The body's media type is not taken here"},
    ProblemKind{kUnsupportedEncoding, "unsupported_encoding", 415,
                "The body's content encoding is not taken"},
    ProblemKind{kInvalidJson, "invalid_json", 400, "The body is not JSON"},
    ProblemKind{kTooDeep, "too_deep", 400, "The body is nested too deeply"},
    ProblemKind{kDuplicateField, "duplicate_field", 400, "A member is given twice"},
    ProblemKind{kUnknownField, "unknown_field", 422, "A member is not known"},
    ProblemKind{kUnknownParameter, "unknown_parameter", 422, "A query parameter is not known"},
    ProblemKind{kMissingField, "missing_field", 422, "A required member is missing"},
    ProblemKind{kWrongType, "wrong_type", 422, "A value has the wrong type"},
    ProblemKind{kWrongLength, "wrong_length", 422, "A length does not fit"},
    ProblemKind{kOutOfRange, "out_of_range", 422, "A number is out of range"},
    ProblemKind{kInvalidValue, "invalid_value", 422, "A value is not allowed"},
    ProblemKind{kDuplicateId, "duplicate_id", 422, "An id is named twice"},
    ProblemKind{kIdempotencyKeyReused, "idempotency_key_reused", 422,
                "Another request was sent with this Idempotency-Key"},
    ProblemKind{kTooManyRays, "too_many_rays", 413, "More rays than one request may have"},
    ProblemKind{kTooManyPoints, "too_many_points", 413, "More points than one request may have"},
    ProblemKind{kInvalidGlb, "invalid_glb", 422, "The model breaks glTF 2.0"},
    ProblemKind{kUnsupportedExtension, "unsupported_extension", 422,
                "The model needs an unsupported extension"},
    ProblemKind{kSceneNotFound, "scene_not_found", 404, "There is no such scene"},
    ProblemKind{kMeshNotFound, "mesh_not_found", 404, "The scene has no such mesh"},
    ProblemKind{kInstanceNotFound, "instance_not_found", 404, "The scene has no such instance"},
    ProblemKind{kJobNotFound, "job_not_found", 404, "There is no such job"},
    ProblemKind{kNameTaken, "name_taken", 409, "Another scene has this name"},
    ProblemKind{kCannotRefit, "cannot_refit", 409, "The mesh's structure cannot be refitted"},
    ProblemKind{kVersionMismatch, "version_mismatch", 412, "The scene has another version by now"},
    ProblemKind{kVersionNotFound, "version_not_found", 404, "The scene has no such version yet"},
    ProblemKind{kVersionGone, "version_gone", 410, "The version is no longer kept"},
    ProblemKind{kLogGone, "log_gone", 410, "The log no longer reaches back so far"},
    ProblemKind{kJobNotDone, "job_not_done", 409, "The job has no result yet"},
    ProblemKind{kJobCancelled, "job_cancelled", 410, "The job was cancelled and has no result"},
    ProblemKind{kLimitExceeded, "limit_exceeded", 413, "The content is larger than a limit"},
    ProblemKind{kTooManyScenes, "too_many_scenes", 507, "The server holds as many scenes as it may"},
    ProblemKind{kMemoryFull, "memory_full", 507, "The server has no memory left for this"},
    ProblemKind{kStorageFull, "storage_full", 507, "The disk is full; nothing was changed"},
    ProblemKind{kStorageFailed, "storage_failed", 503, "The change could not be stored; nothing was changed"},
    ProblemKind{kSceneDamaged, "scene_damaged", 500, "What is stored of the scene is damaged"},
    ProblemKind{kDrawingUnavailable, "drawing_unavailable", 501,
                "The server lacks the program that draws this"},
    ProblemKind{kTooManyJobs, "too_many_jobs", 429, "The queue of jobs is full"},
    ProblemKind{kQuotaExceeded, "quota_exceeded", 429, "The token's quota is used up"},
    ProblemKind{kDeadlineExceeded, "deadline_exceeded", 504, "The request took longer than its deadline"},
    ProblemKind{kCancelled, "cancelled", 503, "The request was stopped before it was done"},
    ProblemKind{kOverloaded, "overloaded", 503, "The server has too much to do"},
    ProblemKind{kNotReady, "not_ready", 503, "The server is not ready"},
    ProblemKind{kInternal, "internal", 500, "The server failed"},
};

constexpr bool in_order() {
  for (std::size_t i = 0; i < kProblems.size(); ++i)
    if (std::size_t(kProblems[i].code) != i) return false;
  return kProblems.size() == std::size_t(kInternal) + 1;
}
static_assert(in_order(), "the table is indexed by ProblemCode");

ProblemCode import_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUnsupported:
      return kUnsupportedExtension;
    case ErrorCode::kLimitExceeded:
      return kLimitExceeded;
    default:
      return kInvalidGlb;
  }
}

ProblemCode update_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kNotFound:
      return kInstanceNotFound;
    case ErrorCode::kUnsupported:
      return kCannotRefit;
    case ErrorCode::kConflict:
      return kVersionMismatch;
    case ErrorCode::kLimitExceeded:
      return kLimitExceeded;
    default:
      return kInvalidValue;
  }
}

ProblemCode query_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kNotFound:
      return kNotFound;
    case ErrorCode::kLimitExceeded:
      return kLimitExceeded;
    default:
      return kInvalidValue;
  }
}

}  // namespace

std::span<const ProblemKind> all_problems() {
  return kProblems;
}

const ProblemKind& describe(ProblemCode code) {
  return kProblems[std::size_t(code)];
}

nlohmann::ordered_json problem_json(const Problem& problem) {
  const ProblemKind& kind = describe(problem.code);
  nlohmann::ordered_json json;
  json["type"] = "urn:gridcast:problem:" + std::string(kind.name);
  json["title"] = kind.title;
  json["status"] = kind.status;
  json["code"] = kind.name;
  json["detail"] = problem.detail;
  json["pointer"] = problem.pointer;
  return json;
}

std::string to_json(const Problem& problem) {
  return problem_json(problem).dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

Problem to_problem(const Error& error, ErrorContext context) {
  switch (error.code) {
    case ErrorCode::kCancelled:
      return {kCancelled, "the work was stopped; nothing was changed", ""};
    case ErrorCode::kIo:
    case ErrorCode::kInternal:
      return {kInternal, "an internal error; the server's log says more", ""};
    default:
      break;
  }
  ProblemCode code = query_code(error.code);
  if (context == ErrorContext::kImport) code = import_code(error.code);
  if (context == ErrorContext::kUpdate) code = update_code(error.code);
  return {code, error.message, error.where};
}

}  // namespace gridcast::proto
