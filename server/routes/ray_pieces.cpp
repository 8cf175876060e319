#include "server/routes/ray_pieces.h"

#include <algorithm>

#include "core/scene/ray_order.h"
#include "core/scene/trace.h"
#include "server/access/caller.h"
#include "server/routes/ray_reply.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::RayQuestion;

// Some milliseconds of work; 2 MB of rows that stay in the caches between the socket and the trace. The
// answers of all go into columns of the whole batch, whose memory the system gives as rays come.
constexpr std::size_t kRaysPerPiece = std::size_t(1) << 16;

/// Which way the batch is traced, by a look at its first rays: sorting goes over all of them.
bool comes_in_order(const scene::Scene& scene, const RayBatch& first) {
  scene::TraceStats look;
  return choose_order(scene, first, look).kind == scene::RayOrderKind::kAsGiven;
}

// Memory follows what has arrived, not what was announced: of what is reserved nothing is touched.
void reserve(HitColumns& hits, std::size_t rays, HitField fields) {
  hits.reserve(rays, fields);
}
void reserve(std::vector<RayStatus>& status, std::size_t rays, HitField /*fields*/) {
  status.reserve(rays);
}
void make_room(HitColumns& hits, std::size_t rays, HitField fields) {
  hits.make_room(rays, fields);
}
void make_room(std::vector<RayStatus>& status, std::size_t rays, HitField /*fields*/) {
  status.resize(rays);
}

Status trace(const scene::Scene& scene, const RayBatch& rays, const scene::TraceOptions& options,
             HitColumns& hits, std::size_t first) {
  return intersect_into(scene, rays, options, hits, first);
}
Status trace(const scene::Scene& scene, const RayBatch& rays, const scene::TraceOptions& options,
             std::vector<RayStatus>& status, std::size_t first) {
  return occluded_into(scene, rays, options, std::span(status).subspan(first, rays.size()));
}

/// One batch on its way.
template <class Answer>
class PieceByPiece {
 public:
  PieceByPiece(const RayReply& to, const scene::Scene& scene, const proto::RayRequest& rays,
               std::size_t count, IncomingBody& incoming)
      : to_(to), scene_(scene), rays_(rays), incoming_(incoming) {
    reserve(answer_, count, rays.options.fields);
    options_.precision = rays.options.precision;
    options_.fields = rays.options.fields;
    options_.mask = rays.options.mask;
    options_.stop = to.cancellation.token();
  }

  /// `piece` holds the first rays and is overwritten by those that follow.
  HttpResponse run(std::string& piece, double receive_ms) {
    receive_ms_ = receive_ms;
    while (true) {
      if (const auto problem = trace_piece(std::as_bytes(std::span(piece))))
        return problem_response(*problem);
      if (incoming_.bytes_left() == 0) break;
      piece.resize(std::min(piece.size(), incoming_.bytes_left()));
      const Clock::time_point before = Clock::now();
      // Who waits for a client gives others the place.
      const auto problem = incoming_.read(piece, [&] { permit_.reset(); });
      receive_ms_ += ms_between(before, Clock::now());
      if (problem) return problem_response(*problem);
    }
    permit_.reset();
    to_.timing.add("receive", receive_ms_);
    to_.timing.add("wait", wait_ms_);
    to_.timing.add("trace", trace_ms_);
    return reply_in_binary(to_, std::move(answer_), &traced_, trace_ms_);
  }

 private:
  std::optional<Problem> trace_piece(std::span<const std::byte> bytes) {
    const Clock::time_point before = Clock::now();
    if (!permit_) {
      if (auto permit = to_.api.gate.enter(to_.cancellation.token())) permit_.emplace(std::move(*permit));
      if (!permit_) return cancelled_problem(to_.cancellation.reason());
    }
    const Clock::time_point begun = Clock::now();
    scene::TraceStats traced;
    options_.stats = &traced;
    const RayBatch piece{bytes, rays_.scalar, rays_.columns, {}};
    make_room(answer_, begin_ + piece.size(), options_.fields);
    const Status done = trace(scene_, piece, options_, answer_, begin_);
    wait_ms_ += ms_between(before, begun);
    trace_ms_ += ms_between(begun, Clock::now());
    if (!done) return problem_of(done.error(), proto::ErrorContext::kQuery, to_.cancellation);
    begin_ += piece.size();
    traced_.packet_rays += traced.packet_rays;
    traced_.single_rays += traced.single_rays;
    traced_.order_ms += traced.order_ms;
    if (traced_.reason.empty()) traced_.reason = traced.reason;
    return std::nullopt;
  }

  const RayReply& to_;
  const scene::Scene& scene_;
  const proto::RayRequest& rays_;
  IncomingBody& incoming_;
  scene::TraceOptions options_;
  scene::TraceStats traced_;
  std::optional<WorkGate::Permit> permit_;
  Answer answer_;
  std::size_t begin_ = 0;  ///< of the next piece
  double receive_ms_ = 0.0, wait_ms_ = 0.0, trace_ms_ = 0.0;
};

}  // namespace

std::optional<HttpResponse> cast_in_pieces(Api& api, const HttpRequest& request, Cancellation& cancellation,
                                           RayQuestion question, std::string& begun) {
  if (question != RayQuestion::kClosest && question != RayQuestion::kAny) return std::nullopt;
  Timing timing;
  IncomingBody& incoming = *request.incoming;
  const std::size_t bytes = incoming.bytes_left();
  const auto opened = open_scene(api, request);
  const auto rays =
      proto::announced_rays(request.header("content-type"), bytes, request.query, api.limits, question);
  if (!std::holds_alternative<OpenScene>(opened) || !rays || reply_format(request) != ReplyFormat::kBinary)
    return std::nullopt;
  const scene::Scene& scene = *std::get<OpenScene>(opened).scene;
  const std::size_t row_bytes = rays->columns * size_bytes(rays->scalar);
  timing.mark("parse");
  const Clock::time_point before = Clock::now();
  begun.resize(std::min(bytes, kRaysPerPiece * row_bytes));
  if (const auto problem = incoming.read(begun, [] {})) return problem_response(*problem);
  const double receive_ms = ms_between(before, Clock::now());
  if (!comes_in_order(scene, {std::as_bytes(std::span(begun)), rays->scalar, rays->columns, {}}))
    return std::nullopt;
  if (rays->options.deadline_ms)
    cancellation.stop_within(std::chrono::duration<double, std::milli>(*rays->options.deadline_ms));
  const std::size_t count = bytes / row_bytes;
  if (const auto problem = access::charge_rays(request, double(count))) return problem_response(*problem);
  const RayReply to{api, scene.version(), rays->options, ReplyFormat::kBinary, cancellation, timing};
  if (question == RayQuestion::kAny)
    return PieceByPiece<std::vector<RayStatus>>(to, scene, *rays, count, incoming).run(begun, receive_ms);
  return PieceByPiece<HitColumns>(to, scene, *rays, count, incoming).run(begun, receive_ms);
}

std::optional<Problem> read_rest(IncomingBody& incoming, std::string& body) {
  // Memory follows what has arrived, not what was announced.
  constexpr std::size_t kFirstBytes = std::size_t(4) << 20;
  while (incoming.bytes_left() > 0) {
    const std::size_t before = body.size();
    body.resize(before + std::min(incoming.bytes_left(), std::max(kFirstBytes, before)));
    if (auto problem = incoming.read(std::span(body).subspan(before), [] {})) return problem;
  }
  return std::nullopt;
}

}  // namespace gridcast::server
