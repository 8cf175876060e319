#include "core/render/render.h"

#include <atomic>
#include <set>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/render/camera.h"
#include "core/render/exposure.h"
#include "core/render/painter.h"
#include "core/scene/trace.h"

namespace gridcast::render {
namespace {

constexpr int kMaxSamples = 4096;
constexpr int kMaxDepth = 64;

/// Calls back when another thousandth is done, from whichever thread completes it.
class Progress {
 public:
  Progress(std::size_t total, const scene::ProgressCallback& callback) : total_(total), callback_(callback) {}
  void one_done() {
    const std::size_t done = done_.fetch_add(1) + 1;
    if (callback_ && done * 1000 / total_ != (done - 1) * 1000 / total_)
      callback_(double(done) / double(total_));
  }

 private:
  std::size_t total_;
  const scene::ProgressCallback& callback_;
  std::atomic<std::size_t> done_{0};
};

// A coarse look: a camera that sees nothing, or one and the same triangle everywhere, makes no picture.
bool shows_something(const scene::Scene& scene, const scene::Camera& camera) {
  constexpr int kProbes = 16;
  std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
  for (int i = 0; i < kProbes * kProbes && seen.size() < 2; ++i) {
    const Ray ray = primary_ray(camera, kProbes, kProbes, i % kProbes + 0.5, int(i / kProbes) + 0.5);
    const SurfaceHit hit = scene::intersect(scene, ray);
    seen.insert({hit.instance_id, hit.primitive_id});
  }
  return seen.size() > 1;
}

Error out_of_range(std::string message, std::string where) {
  return {ErrorCode::kInvalidArgument, std::move(message), std::move(where)};
}

}  // namespace

Status validate(const RenderSettings& settings) {
  if (settings.width_px < 1 || settings.width_px > kMaxSidePx)
    return out_of_range("the width must be 1 to 16384 pixels", "/width_px");
  if (settings.height_px < 1 || settings.height_px > kMaxSidePx)
    return out_of_range("the height must be 1 to 16384 pixels", "/height_px");
  if (settings.samples < 1 || settings.samples > kMaxSamples)
    return out_of_range("there must be 1 to 4096 samples per pixel", "/samples");
  if (settings.max_depth < 0 || settings.max_depth > kMaxDepth)
    return out_of_range("the depth must be 0 to 64", "/max_depth");
  if (!is_usable(settings.camera)) return out_of_range("the camera makes no valid rays", "/camera");
  return ok_status();
}

Result<Film> render(const scene::Scene& scene, const RenderSettings& settings, std::stop_token stop,
                    const scene::ProgressCallback& progress) {
  if (Status status = validate(settings); !status) return status.error();
  Film film;
  film.width_px = settings.width_px;
  film.height_px = settings.height_px;
  const Lighting lighting = light_scene(scene, settings);
  film.exposure = lighting.exposure;
  const Painter painter(scene, settings, lighting, film);

  const int columns = (film.width_px + kTileSidePx - 1) / kTileSidePx;
  const int rows = (film.height_px + kTileSidePx - 1) / kTileSidePx;
  const std::size_t tiles = std::size_t(columns) * std::size_t(rows);
  Progress done(tiles, progress);
  std::atomic<bool> cancelled{false};
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, tiles, 1), [&](const auto& range) {
    TileScratch scratch(scene, settings.precision, settings.mask);
    for (std::size_t tile = range.begin(); tile != range.end(); ++tile) {
      const int left = int(tile % std::size_t(columns)) * kTileSidePx;
      const int top = int(tile / std::size_t(columns)) * kTileSidePx;
      if (cancelled || !painter.paint(left, top, stop, scratch)) {
        cancelled = true;
        return;
      }
      done.one_done();
    }
  });
  if (cancelled) return Error{ErrorCode::kCancelled, "the picture was cancelled", ""};
  return film;
}

scene::Camera default_camera(const scene::Scene& scene, double aspect_ratio) {
  return default_camera(scene, scene.bounds(), aspect_ratio);
}

scene::Camera default_camera(const scene::Scene& scene, const Bounds3d& bounds, double aspect_ratio) {
  for (const scene::Camera& camera : scene.data().cameras)
    if (is_usable(camera) && shows_something(scene, camera)) return camera;
  constexpr double kFieldOfViewRad = 0.7;
  return frame(bounds, kFieldOfViewRad, aspect_ratio);
}

}  // namespace gridcast::render
