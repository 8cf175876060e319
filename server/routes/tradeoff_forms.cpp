#include "server/routes/tradeoff_forms.h"

#include <memory>
#include <utility>

#include "proto/media_type.h"
#include "server/chart/chart_gnuplot.h"
#include "server/chart/chart_vega.h"
#include "server/chart/gnuplot.h"
#include "server/chart/tradeoff_json.h"
#include "server/http/problem.h"

namespace gridcast::server {
namespace {

proto::Problem drawing_problem(const Error& error, const Cancellation& cancellation) {
  if (error.code == ErrorCode::kUnsupported)
    return {
        proto::ProblemCode::kDrawingUnavailable,
        "SVG and PNG are drawn by gnuplot, which is not installed here (Debian: gnuplot-nox); JSON, CSV and "
        "Vega-Lite need nothing",
        "Accept"};
  return problem_of(error, proto::ErrorContext::kQuery, cancellation);
}

HttpResponse::Form drawn(std::shared_ptr<const Chart> chart, std::string_view media_type, PlotFormat format) {
  return {std::string(media_type), "",
          [chart = std::move(chart),
           format](const Cancellation& cancellation) -> std::variant<std::string, proto::Problem> {
            const auto drawing = run_gnuplot(gnuplot_script(*chart, format), cancellation.token());
            if (!drawing) return drawing_problem(drawing.error(), cancellation);
            return std::string(reinterpret_cast<const char*>(drawing->data()), drawing->size());
          }};
}

}  // namespace

std::vector<HttpResponse::Form> tradeoff_forms(const measure::TradeoffReport& report,
                                               const std::string& name) {
  const auto chart = std::make_shared<const Chart>(make_chart(report, name));
  return {{std::string(proto::kCsvMediaType), tradeoff_csv(report)},
          {std::string(proto::kVegaLiteMediaType), vega_chart(*chart, report).dump()},
          drawn(chart, proto::kSvgMediaType, PlotFormat::kSvg),
          drawn(chart, proto::kPngMediaType, PlotFormat::kPng)};
}

}  // namespace gridcast::server
