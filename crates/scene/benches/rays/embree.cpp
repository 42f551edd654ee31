// Embree 3 on the very rays of the bench, in one thread: Debian's libembree-dev, where it is installed.
//
//   embree SCENE.tris          triangles of 9 f32 each, little-endian
//
// Reads a line for each round, "MODE KIND FILE", and answers with a line, "HITS SECONDS". MODE: fast or robust (no leaks at edges, as
// relight promises). KIND: closest, any, or packet (eight rays together). FILE: rays of 8 f32 each: origin, t_min, direction, t_max.
// A mode's hierarchy is built when it is first asked for, with Embree's best quality; a file's rays are read once.
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <embree3/rtcore.h>

static std::vector<float> floats_of(const std::string& file) {
    std::ifstream in(file, std::ios::binary | std::ios::ate);
    std::vector<float> values(in ? static_cast<size_t>(in.tellg()) / sizeof(float) : 0);
    in.seekg(0);
    in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(values.size() * sizeof(float)));
    return values;
}

static RTCScene built(RTCDevice device, const std::vector<float>& corners, bool robust) {
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneFlags(scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const size_t count = corners.size() / 9;
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * count));
    auto* indices = static_cast<uint32_t*>(
        rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t), count));
    std::copy(corners.begin(), corners.end(), vertices);
    for (uint32_t i = 0; i < 3 * count; ++i) indices[i] = i;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(scene);
    return scene;
}

static RTCRay ray_of(const float* r) {
    RTCRay ray{};
    ray.org_x = r[0], ray.org_y = r[1], ray.org_z = r[2], ray.tnear = r[3];
    ray.dir_x = r[4], ray.dir_y = r[5], ray.dir_z = r[6], ray.tfar = r[7];
    ray.mask = ~0u;
    return ray;
}

static size_t closest(RTCScene scene, RTCIntersectContext& context, const std::vector<float>& rays) {
    size_t hits = 0;
    for (size_t i = 0; i + 8 <= rays.size(); i += 8) {
        RTCRayHit hit{};
        hit.ray = ray_of(&rays[i]);
        hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &context, &hit);
        hits += hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    }
    return hits;
}

static size_t any(RTCScene scene, RTCIntersectContext& context, const std::vector<float>& rays) {
    size_t hits = 0;
    for (size_t i = 0; i + 8 <= rays.size(); i += 8) {
        RTCRay ray = ray_of(&rays[i]);
        rtcOccluded1(scene, &context, &ray);
        hits += ray.tfar < 0.0f;
    }
    return hits;
}

static size_t packet(RTCScene scene, RTCIntersectContext& context, const std::vector<float>& rays) {
    size_t hits = 0;
    const size_t count = rays.size() / 8;
    for (size_t first = 0; first < count; first += 8) {
        alignas(32) int valid[8] = {};
        RTCRay8 eight{};
        for (size_t lane = 0; lane < 8 && first + lane < count; ++lane) {
            const float* r = &rays[8 * (first + lane)];
            valid[lane] = -1;
            eight.org_x[lane] = r[0], eight.org_y[lane] = r[1], eight.org_z[lane] = r[2], eight.tnear[lane] = r[3];
            eight.dir_x[lane] = r[4], eight.dir_y[lane] = r[5], eight.dir_z[lane] = r[6], eight.tfar[lane] = r[7];
            eight.mask[lane] = ~0u;
        }
        rtcOccluded8(valid, scene, &context, &eight);
        for (size_t lane = 0; lane < 8; ++lane) hits += valid[lane] && eight.tfar[lane] < 0.0f;
    }
    return hits;
}

int main(int argc, char** argv) {
    if (argc != 2) return 2;
    RTCDevice device = rtcNewDevice("threads=1");
    if (!device) return 1;
    const std::vector<float> corners = floats_of(argv[1]);
    std::map<std::string, RTCScene> scenes;
    std::map<std::string, std::vector<float>> files;
    for (std::string line; std::getline(std::cin, line);) {
        std::string mode, kind, file;
        std::istringstream words(line);
        words >> mode >> kind >> std::ws;
        std::getline(words, file);
        if (!scenes.count(mode)) scenes[mode] = built(device, corners, mode == "robust");
        if (!files.count(file)) files[file] = floats_of(file);
        const std::vector<float>& rays = files[file];
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        context.flags = kind == "packet" ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
        const auto start = std::chrono::steady_clock::now();
        const size_t hits = kind == "closest" ? closest(scenes[mode], context, rays)
                            : kind == "any"   ? any(scenes[mode], context, rays)
                                              : packet(scenes[mode], context, rays);
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        std::cout << hits << ' ' << seconds.count() << std::endl;
    }
    for (auto& scene : scenes) rtcReleaseScene(scene.second);
    rtcReleaseDevice(device);
}
