#include "core/render/whitted.h"

#include <algorithm>
#include <optional>

namespace gridcast::render {
namespace {

// Rays that change the displayed picture by less than half a step of 8 bits are not traced. This also bounds
// the tree of rays inside glass: the weights of a level add up to 1 at most.
constexpr float kMinWeight = 1.F / 512.F;

// Panes that a shadow ray may pass before it counts as blocked.
constexpr int kMaxGlassLayers = 32;

float max_component(const Vec3f& v) {
  return std::max({v.x, v.y, v.z});
}

Vec3f emitted(const scene::Material& material) {
  return glm::max(Vec3f(material.emissive[0], material.emissive[1], material.emissive[2]), Vec3f(0.F));
}

Vec3f base_color(const scene::Material& material) {
  return {material.base_color[0], material.base_color[1], material.base_color[2]};
}

// An interpolated normal can mirror a ray into the surface: such a ray is lifted until it grazes it.
Vec3d mirrored(const Surface& surface) {
  constexpr double kGrazing = 0.01;
  const Vec3d r = 2.0 * glm::dot(surface.normal, surface.view) * surface.normal - surface.view;
  const double cosine = glm::dot(r, surface.geometric);
  return cosine >= kGrazing ? r : glm::normalize(r + (kGrazing - cosine) * surface.geometric);
}

struct Refraction {
  std::optional<Vec3d> direction;  // none: total internal reflection
  float cosine = 1.F;  // on the side of the thinner medium, which is the one Schlick's formula is for
};

// Snell's law at a boundary between air and the material; the file's meshes are closed solids by assumption.
Refraction refract(const Surface& surface) {
  const double ior = std::max(double(surface.material->ior), 1.0);
  const double eta = surface.side == Side::kFront ? 1.0 / ior : ior;
  const double cos_in = glm::dot(surface.normal, surface.view);
  const double cos_out_squared = 1.0 - eta * eta * (1.0 - cos_in * cos_in);
  if (cos_out_squared <= 0.0) return {};
  const double cos_out = std::sqrt(cos_out_squared);
  const Vec3d direction = -eta * surface.view + (eta * cos_in - cos_out) * surface.normal;
  return {glm::normalize(direction), float(std::min(cos_in, cos_out))};
}

/// Calls lit(index, illumination, what the light adds where nothing shadows it) for every light that counts.
template <class Lit>
void each_light(const Lighting& lighting, const Surface& surface, const Brdf& brdf, const Lit& lit) {
  for (std::size_t i = 0; i < lighting.lights.size(); ++i) {
    const Illumination illumination = illuminate(lighting.lights[i], surface.point);
    if (!(max_component(illumination.irradiance) > 0.F)) continue;
    const Vec3d towards = glm::normalize(illumination.to_light);
    const float cosine = float(glm::dot(surface.normal, towards));
    if (!(cosine > 0.F)) continue;
    const Vec3f added =
        brdf.evaluate(surface.normal, surface.view, towards) * illumination.irradiance * cosine;
    if (max_component(added) * lighting.exposure > kMinWeight) lit(i, illumination, added);
  }
}

Vec3f next_answer(ShadowQueue& queue) {
  return queue.status[queue.next++] == RayStatus::kHit ? Vec3f(0.F) : Vec3f(1.F);
}

}  // namespace

Whitted::Whitted(const scene::Scene& scene, const Lighting& lighting, const RenderSettings& settings,
                 int max_depth)
    : scene_(scene),
      lighting_(lighting),
      precision_(settings.precision),
      mask_(settings.mask),
      max_depth_(max_depth) {
  const auto& materials = scene.data().materials;
  has_glass_ = std::any_of(materials.begin(), materials.end(),
                           [](const scene::Material& material) { return material.transmission > 0.F; });
}

Vec3f Whitted::radiance(const Ray& ray, const SurfaceHit& hit) const {
  return shade(ray, hit, {});
}

void Whitted::radiance(std::span<const Ray> rays, std::span<const SurfaceHit> hits, scene::RunTracer& tracer,
                       ShadeScratch& scratch, std::span<Vec3f> colors) const {
  scratch.surfaces.resize(rays.size());
  scratch.queues.resize(lighting_.lights.size());
  for (ShadowQueue& queue : scratch.queues) {
    queue.rays.clear();
    queue.from.clear();
    queue.next = 0;
  }
  // Through glass a shadow ray goes on from surface to surface, alone.
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (hits[i].status != RayStatus::kHit) continue;
    scratch.surfaces[i] = make_surface(scene_, rays[i], hits[i]);
    if (!has_glass_) ask_for_shadows(scratch.surfaces[i], scratch.queues);
  }
  for (ShadowQueue& queue : scratch.queues) {
    queue.status.resize(queue.rays.size());
    tracer.occluded(queue.rays, queue.from, queue.status);
  }
  for (std::size_t i = 0; i < rays.size(); ++i) {
    colors[i] = hits[i].status == RayStatus::kHit
                    ? shade(scratch.surfaces[i], {}, has_glass_ ? nullptr : &scratch.queues)
                    : shade(rays[i], hits[i], {});
  }
}

Vec3f Whitted::trace(const Ray& ray, PrimitiveRef from, Path path) const {
  return shade(ray, scene::intersect(scene_, ray, precision_, from, mask_), path);
}

Vec3f Whitted::shade(const Ray& ray, const SurfaceHit& hit, Path path) const {
  if (hit.status != RayStatus::kHit) return lighting_.sky.radiance(glm::normalize(ray.direction));
  return shade(make_surface(scene_, ray, hit), path, nullptr);
}

Vec3f Whitted::shade(const Surface& surface, Path path, std::vector<ShadowQueue>* answered) const {
  const scene::Material& material = *surface.material;
  // Unlit colours are meant for the display as they are.
  if (material.unlit) return base_color(material) / lighting_.exposure;

  const Brdf brdf = make_brdf(material);
  const float cos_view = float(glm::dot(surface.normal, surface.view));
  Vec3f color = emitted(material) + direct(surface, brdf, answered);
  color += brdf.diffuse * (lighting_.sky.ambient(surface.normal) + cos_view * lighting_.head_light);

  Vec3f mirror = brdf.fresnel(cos_view);
  if (max_component(brdf.transmit) > 0.F) {
    const Refraction refraction = refract(surface);
    if (refraction.direction) {
      mirror = brdf.fresnel(refraction.cosine);
      color += refracted(surface, *refraction.direction, (Vec3f(1.F) - mirror) * brdf.transmit, path);
    } else {
      mirror = glm::mix(mirror, Vec3f(1.F), std::clamp(material.transmission, 0.F, 1.F));
    }
  }
  return color + reflected(surface, brdf, mirror, path);
}

Vec3f Whitted::direct(const Surface& surface, const Brdf& brdf, std::vector<ShadowQueue>* answered) const {
  Vec3f sum(0.F);
  each_light(
      lighting_, surface, brdf, [&](std::size_t light, const Illumination& illumination, const Vec3f& lit) {
        sum +=
            lit * (answered != nullptr ? next_answer((*answered)[light]) : visibility(surface, illumination));
      });
  return sum;
}

void Whitted::ask_for_shadows(const Surface& surface, std::vector<ShadowQueue>& queues) const {
  if (surface.material->unlit) return;
  each_light(lighting_, surface, make_brdf(*surface.material),
             [&](std::size_t light, const Illumination& illumination, const Vec3f& /*lit*/) {
               queues[light].rays.push_back(shadow_ray(surface, illumination));
               queues[light].from.push_back(surface.primitive());
             });
}

Vec3f Whitted::reflected(const Surface& surface, const Brdf& brdf, const Vec3f& share, Path path) const {
  // The smooth part of the surface mirrors the scene, the rest sees a blurred sky.
  const float sharpness = (1.F - brdf.roughness) * (1.F - brdf.roughness);
  const Vec3d direction = mirrored(surface);
  const Vec3f blurred = lighting_.sky.glossy(direction, brdf.roughness);
  const float weight = path.weight * sharpness * max_component(share);
  if (path.depth >= max_depth_ || weight < kMinWeight) return share * blurred;
  const Ray ray{spawn_origin(scene_, surface, surface.point, Leave::kTowardsViewer), direction};
  const Vec3f seen = trace(ray, surface.primitive(), {path.depth + 1, weight});
  return share * glm::mix(blurred, seen, sharpness);
}

Vec3f Whitted::refracted(const Surface& surface, const Vec3d& direction, const Vec3f& share,
                         Path path) const {
  const float weight = path.weight * max_component(share);
  if (path.depth >= max_depth_ || weight < kMinWeight) return share * lighting_.sky.radiance(direction);
  const Ray ray{spawn_origin(scene_, surface, surface.point, Leave::kThrough), direction};
  return share * trace(ray, surface.primitive(), {path.depth + 1, weight});
}

Ray Whitted::shadow_ray(const Surface& surface, const Illumination& light) const {
  return {spawn_origin(scene_, surface, surface.smooth_point, Leave::kTowardsViewer), light.to_light, 0.0,
          light.tfar};
}

Vec3f Whitted::visibility(const Surface& surface, const Illumination& light) const {
  const Ray shadow = shadow_ray(surface, light);
  if (has_glass_) return through_glass(shadow, surface.primitive());
  const RayStatus status = scene::occluded(scene_, shadow, precision_, surface.primitive(), mask_);
  return status == RayStatus::kHit ? Vec3f(0.F) : Vec3f(1.F);
}

// Straight through, tinted at every surface: no caustics, but no black shadows of glass either.
Vec3f Whitted::through_glass(Ray ray, PrimitiveRef from) const {
  Vec3f passed(1.F);
  for (int layer = 0; layer < kMaxGlassLayers; ++layer) {
    const SurfaceHit hit = scene::intersect(scene_, ray, precision_, from, mask_);
    if (hit.status != RayStatus::kHit) return passed;
    const Surface surface = make_surface(scene_, ray, hit);
    passed *= make_brdf(*surface.material).transmit;
    if (!(max_component(passed) > kMinWeight)) break;
    ray.origin = spawn_origin(scene_, surface, surface.point, Leave::kThrough);
    ray.tfar -= hit.t;
    from = surface.primitive();
  }
  return Vec3f(0.F);
}

}  // namespace gridcast::render
