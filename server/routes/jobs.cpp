#include <atomic>
#include <ctime>

#include "proto/job_reply.h"
#include "proto/media_type.h"
#include "proto/prefer.h"
#include "server/access/caller.h"
#include "server/http/problem.h"
#include "server/routes/api.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

// Proxies close a connection that is silent for half a minute or less.
constexpr std::chrono::seconds kHeartbeatPeriod{5};
// Between two events of one stream; a client that reads slowly gets the newest state, not a backlog.
constexpr std::chrono::milliseconds kEventPeriod{100};

std::string rfc3339(std::chrono::system_clock::time_point time) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(time);
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

proto::JobInfo job_info(const Job& job, const JobView& view) {
  proto::JobInfo info{job.id(),
                      job.subject().kind,
                      job.subject().scene,
                      job.subject().scene_version,
                      std::string(to_string(view.state)),
                      view.progress,
                      rfc3339(job.created()),
                      view.wait_ms,
                      view.run_ms,
                      std::nullopt,
                      view.problem};
  if (view.result) info.result = proto::JobInfo::Result{view.result->content_type, view.result->body.size()};
  return info;
}

HttpResponse job_json(const Job& job, const JobView& view, int status) {
  HttpResponse response{status, std::string(proto::kJsonMediaType), to_json(job_info(job, view)), {}};
  return response.with("Cache-Control", "no-store");
}

std::variant<std::shared_ptr<Job>, Problem> open_job(const Api& api, const HttpRequest& request) {
  if (auto problem = proto::check_query(request.query)) return std::move(*problem);
  auto job = api.jobs.find(request.capture("j"));
  if (!job || !access::sees_job_of(request, job->subject().owner))
    return Problem{ProblemCode::kJobNotFound, "there is no such job, or it is forgotten", ""};
  return job;
}

HttpResponse get_job(const Api& api, const HttpRequest& request) {
  const auto opened = open_job(api, request);
  if (const auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const Job& job = *std::get<std::shared_ptr<Job>>(opened);
  return job_json(job, job.view(), 200);
}

/// Makes the body of a form that has none yet; a child process may work for it, so it takes a place.
std::variant<std::string, Problem> body_of(Api& api, HttpResponse::Form form,
                                           const Cancellation& cancellation) {
  if (!form.make) return std::move(form.body);
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return cancelled_problem(cancellation.reason());
  return form.make(cancellation);
}

/// A result of one form is given whatever `accept` says: it was negotiated when the job was started.
HttpResponse in_accepted_form(Api& api, HttpResponse result, std::string_view accept,
                              const Cancellation& cancellation) {
  if (result.other_forms.empty()) return result;
  std::vector<std::string_view> offered{result.content_type};
  for (const HttpResponse::Form& form : result.other_forms) offered.push_back(form.content_type);
  const auto chosen = proto::negotiate(accept, offered);
  if (!chosen) {
    std::string detail = "this result comes as";
    for (const std::string_view type : offered) detail.append(" ").append(type);
    return problem_response({ProblemCode::kNotAcceptable, detail, "Accept"});
  }
  if (*chosen > 0) {
    HttpResponse::Form form = std::move(result.other_forms[*chosen - 1]);
    result.content_type = form.content_type;
    auto body = body_of(api, std::move(form), cancellation);
    if (const auto* problem = std::get_if<Problem>(&body)) return problem_response(*problem);
    result.body = std::get<std::string>(std::move(body));
  }
  result.other_forms.clear();
  return result;
}

HttpResponse get_result(Api& api, const HttpRequest& request, const Cancellation& cancellation) {
  const auto opened = open_job(api, request);
  if (const auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  return result_response(api, *std::get<std::shared_ptr<Job>>(opened), request.header("accept"),
                         cancellation);
}

HttpResponse delete_job(Api& api, const HttpRequest& request) {
  const auto opened = open_job(api, request);
  if (const auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  (void)api.jobs.remove(request.capture("j"));
  return {204, "", "", {}};
}

/// A place among the few streams that may be open at once.
class StreamPlace {
 public:
  explicit StreamPlace(std::atomic<std::size_t>& open) : open_(open) { ++open_; }
  ~StreamPlace() { --open_; }
  StreamPlace(const StreamPlace&) = delete;
  StreamPlace& operator=(const StreamPlace&) = delete;

 private:
  std::atomic<std::size_t>& open_;
};

/// Sends the newest state whenever it has changed, until the job has ended. Nothing is queued up for a slow
/// reader: what it missed is not sent.
void write_events(const Job& job, const Cancellation& cancellation, const WritePart& write) {
  const std::stop_token stop = cancellation.token();
  std::uint64_t seen = 0;
  std::optional<JobState> told;
  while (!stop.stop_requested()) {
    const auto view = job.wait_past(seen, Clock::now() + kHeartbeatPeriod, stop);
    if (stop.stop_requested()) return;
    if (!view) {
      if (!write(proto::kHeartbeat)) return;
      continue;
    }
    const std::string_view name = told == view->state ? "progress" : "state";
    if (!write(proto::event_text(name, view->revision, to_json(job_info(job, *view))))) return;
    if (is_final(view->state)) return;
    seen = view->revision;
    told = view->state;
    (void)job.wait_final(Clock::now() + kEventPeriod, stop);
  }
}

HttpResponse get_events(Api& api, const HttpRequest& request) {
  const auto opened = open_job(api, request);
  if (const auto* problem = std::get_if<Problem>(&opened)) return problem_response(*problem);
  const std::shared_ptr<Job>& job = std::get<std::shared_ptr<Job>>(opened);
  // A browser's EventSource comes back after the end with the id of what it saw last; 204 sends it away.
  const JobView view = job->view();
  if (is_final(view.state) && request.header("last-event-id") == std::to_string(view.revision))
    return {204, "", "", {}};
  auto place = std::make_shared<StreamPlace>(api.event_streams);
  if (api.event_streams > api.limits.event_streams)
    return problem_response({ProblemCode::kOverloaded, "too many event streams are open", ""});
  HttpResponse response{200, std::string(proto::kEventsMediaType), "", {}};
  response.stream = [job, place](const Cancellation& cancellation, const WritePart& write) {
    write_events(*job, cancellation, write);
  };
  // The last one tells nginx not to hold events back.
  return response.with("Cache-Control", "no-store").with("X-Accel-Buffering", "no");
}

}  // namespace

bool wants_job(const HttpRequest& request) {
  return proto::parse_prefer(request.header("prefer")).respond_async;
}

HttpResponse result_response(Api& api, const Job& job, std::string_view accept,
                             const Cancellation& cancellation) {
  const JobView view = job.view();
  switch (view.state) {
    case JobState::kDone:
      return in_accepted_form(api, *view.result, accept, cancellation);
    case JobState::kFailed:
      return problem_response(*view.problem);
    case JobState::kCancelled:
      return problem_response({ProblemCode::kJobCancelled, view.problem->detail, ""});
    case JobState::kQueued:
    case JobState::kRunning:
      break;
  }
  return problem_response({ProblemCode::kJobNotDone,
                           "the job is " + std::string(to_string(view.state)) + "; ask again later", ""});
}

HttpResponse answer_with_job(Api& api, const HttpRequest& request, const Cancellation& cancellation,
                             JobSubject subject, JobWork work) {
  subject.owner = access::owner_of(request);
  auto submitted = api.jobs.submit(std::move(subject), std::move(work));
  if (const auto* problem = std::get_if<Problem>(&submitted)) return problem_response(*problem);
  const std::shared_ptr<Job> job = std::get<std::shared_ptr<Job>>(submitted);
  const proto::Preferences preferences = proto::parse_prefer(request.header("prefer"));
  if (preferences.wait_s) {
    const auto wait =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(*preferences.wait_s));
    const auto view =
        job->wait_final(std::min(Clock::now() + wait, cancellation.deadline()), cancellation.token());
    // Nobody knows the job's name when its client has gone.
    if (cancellation.reason() == CancelReason::kDisconnected) (void)api.jobs.remove(job->id());
    if (view && view->result)
      return in_accepted_form(api, *view->result, request.header("accept"), cancellation);
    if (view && view->problem) return problem_response(*view->problem);
  }
  HttpResponse response = job_json(*job, job->view(), 202);
  response.with("Location", "/v1/jobs/" + job->id());
  if (preferences.respond_async) response.with("Preference-Applied", "respond-async");
  return response;
}

void add_job_routes(Router& router, Api& api) {
  const std::string one = "/v1/jobs/{j}";
  router.add({"GET", one, {}, [&api](const HttpRequest& r, Cancellation&) { return get_job(api, r); }});
  router.add({"DELETE", one, {}, [&api](const HttpRequest& r, Cancellation&) { return delete_job(api, r); }});
  router.add({"GET", one + "/result", {}, [&api](const HttpRequest& r, const Cancellation& c) {
                return get_result(api, r, c);
              }});
  router.add({"GET", one + "/events", {}, [&api](const HttpRequest& r, Cancellation&) {
                return get_events(api, r);
              }});
}

}  // namespace gridcast::server
