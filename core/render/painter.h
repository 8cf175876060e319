#pragma once

#include <stop_token>
#include <vector>

#include "core/render/render.h"
#include "core/render/whitted.h"

namespace gridcast::render {

// Neighbouring pixels share nodes in the cache and go in packets; 16 x 16 of them are a few hundred
// microseconds of work, so cores stay busy to the end and a stop request is seen soon.
inline constexpr int kTileSidePx = 16;

/// Memory of a task that paints tiles.
struct TileScratch {
  TileScratch(const scene::Scene& scene, Precision precision, InstanceMask mask)
      : tracer(scene, precision, mask) {}

  struct Pixel {
    int x, y;
  };

  scene::RunTracer tracer;
  ShadeScratch shading;
  std::vector<Pixel> pixels;
  std::vector<Vec3d> sums;  ///< of the samples of each pixel
  std::vector<int> covered;
  // A run of primary rays.
  std::vector<Ray> rays;
  std::vector<std::size_t> pixel_of;
  std::vector<SurfaceHit> hits;
  std::vector<Vec3f> colors;
};

/// Renders tiles into the film; one is shared by all threads, which write to different pixels.
class Painter {
 public:
  /// Adds the layers to `film`. Keeps references: all outlive it.
  Painter(const scene::Scene& scene, const RenderSettings& settings, const Lighting& lighting, Film& film);

  /// The tile whose upper left pixel this is. False when stopped on the way.
  [[nodiscard]] bool paint(int left, int top, const std::stop_token& stop, TileScratch& scratch) const;

 private:
  void choose_pixels(int left, int top, TileScratch& scratch) const;
  void paint_exact(TileScratch& scratch) const;
  [[nodiscard]] bool paint_color(const std::stop_token& stop, TileScratch& scratch) const;
  void shade_run(TileScratch& scratch) const;
  [[nodiscard]] Ray ray_through(double x, double y) const;

  const RenderSettings& settings_;
  Film& film_;
  std::vector<LayerKind> kinds_;
  Whitted whitted_;
  bool has_color_ = false;
  bool has_exact_ = false;
};

}  // namespace gridcast::render
