#include "core/render/render.h"

#include <algorithm>
#include <atomic>
#include <set>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/render/camera.h"
#include "core/render/exposure.h"
#include "core/render/sampling.h"
#include "core/render/whitted.h"

namespace gridcast::render {
namespace {

// Neighbouring pixels share nodes in the cache; 16 x 16 of them are a few hundred microseconds of work, so
// cores stay busy to the end and a stop request is seen soon.
constexpr int kTileSidePx = 16;

constexpr int kMaxSamples = 4096;
constexpr int kMaxDepth = 64;

LayerKind own_layer(Integrator integrator) {
  switch (integrator) {
    case Integrator::kDepth:
      return LayerKind::kDepth;
    case Integrator::kNormal:
      return LayerKind::kNormal;
    case Integrator::kId:
      return LayerKind::kInstanceId;
    case Integrator::kWhitted:
      break;
  }
  return LayerKind::kColor;
}

std::vector<LayerKind> wanted_layers(const RenderSettings& settings) {
  std::vector<LayerKind> kinds{own_layer(settings.integrator)};
  for (const LayerKind kind : settings.layers)
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) kinds.push_back(kind);
  return kinds;
}

Layer make_layer(LayerKind kind, std::size_t pixels) {
  Layer layer{std::string(to_string(kind)), {}, {}, {}};
  if (kind == LayerKind::kColor) layer.channels = {"R", "G", "B", "A"};
  if (kind == LayerKind::kDepth) layer.channels = {"Z"};
  if (kind == LayerKind::kNormal) layer.channels = {"X", "Y", "Z"};
  if (layer.channels.empty()) {
    layer.channels = {"id"};
    layer.ids.resize(pixels);
  } else {
    layer.values.resize(pixels * layer.channels.size());
  }
  return layer;
}

/// Renders pixels into the film; one is shared by all threads, which write to different pixels.
class Painter {
 public:
  Painter(const scene::Scene& scene, const RenderSettings& settings, const Lighting& lighting, Film& film)
      : scene_(scene),
        settings_(settings),
        film_(film),
        kinds_(wanted_layers(settings)),
        whitted_(scene, lighting, settings.precision, settings.max_depth) {
    for (const LayerKind kind : kinds_) {
      film_.layers.push_back(make_layer(kind, std::size_t(film.width_px) * std::size_t(film.height_px)));
      (kind == LayerKind::kColor ? has_color_ : has_exact_) = true;
    }
  }

  void paint(int x, int y) const {
    const std::size_t pixel = std::size_t(y) * std::size_t(film_.width_px) + std::size_t(x);
    const SurfaceHit hit = has_exact_ ? cast(center(x, y)) : SurfaceHit{};
    const glm::vec4 color = has_color_ ? average(x, y) : glm::vec4(0.F);
    for (std::size_t i = 0; i < kinds_.size(); ++i) write(kinds_[i], film_.layers[i], pixel, hit, color);
  }

 private:
  [[nodiscard]] Ray center(int x, int y) const {
    return primary_ray(settings_.camera, film_.width_px, film_.height_px, x + 0.5, y + 0.5);
  }
  [[nodiscard]] SurfaceHit cast(const Ray& ray) const {
    return scene::intersect(scene_, ray, settings_.precision);
  }

  [[nodiscard]] glm::vec4 average(int x, int y) const {
    Vec3d sum(0.0);
    int covered = 0;
    for (int i = 0; i < settings_.samples; ++i) {
      const glm::dvec2 offset = pixel_sample(std::uint32_t(x), std::uint32_t(y), std::uint32_t(i),
                                             std::uint32_t(settings_.samples));
      const Ray ray =
          primary_ray(settings_.camera, film_.width_px, film_.height_px, x + offset.x, y + offset.y);
      const SurfaceHit hit = cast(ray);
      if (hit.status == RayStatus::kHit) ++covered;
      sum += Vec3d(whitted_.radiance(ray, hit));
    }
    return {Vec3f(sum / double(settings_.samples)), float(covered) / float(settings_.samples)};
  }

  static void write(LayerKind kind, Layer& layer, std::size_t pixel, const SurfaceHit& hit,
                    const glm::vec4& color) {
    float* values = layer.values.empty() ? nullptr : &layer.values[pixel * layer.channels.size()];
    switch (kind) {
      case LayerKind::kColor:
        std::copy_n(&color[0], 4, values);
        break;
      case LayerKind::kDepth:
        *values = float(hit.t);
        break;
      case LayerKind::kNormal:
        for (int axis = 0; axis < 3; ++axis) values[axis] = float(hit.normal[axis]);
        break;
      case LayerKind::kInstanceId:
        layer.ids[pixel] = hit.instance_id;
        break;
      case LayerKind::kMeshId:
        layer.ids[pixel] = hit.mesh_id;
        break;
      case LayerKind::kPrimitiveId:
        layer.ids[pixel] = hit.primitive_id;
        break;
    }
  }

  const scene::Scene& scene_;
  const RenderSettings& settings_;
  Film& film_;
  std::vector<LayerKind> kinds_;
  Whitted whitted_;
  bool has_color_ = false;
  bool has_exact_ = false;
};

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
    for (std::size_t tile = range.begin(); tile != range.end(); ++tile) {
      const int left = int(tile % std::size_t(columns)) * kTileSidePx;
      const int top = int(tile / std::size_t(columns)) * kTileSidePx;
      for (int y = top; y < std::min(top + kTileSidePx, film.height_px); ++y) {
        for (int x = left; x < std::min(left + kTileSidePx, film.width_px); ++x) {
          // At every pixel, not only at every tile: a pixel of 4096 samples takes long.
          if (stop.stop_requested()) cancelled = true;
          if (cancelled) return;
          painter.paint(x, y);
        }
      }
      done.one_done();
    }
  });
  if (cancelled) return Error{ErrorCode::kCancelled, "the picture was cancelled", ""};
  return film;
}

scene::Camera default_camera(const scene::Scene& scene, double aspect_ratio) {
  for (const scene::Camera& camera : scene.data().cameras)
    if (is_usable(camera) && shows_something(scene, camera)) return camera;
  constexpr double kFieldOfViewRad = 0.7;
  return frame(scene.bounds(), kFieldOfViewRad, aspect_ratio);
}

}  // namespace gridcast::render
