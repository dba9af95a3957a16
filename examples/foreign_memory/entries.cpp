// A memory in C++ that knows evonav's files only: the box around each detection, merged by label and distance.
//
//     g++ -O2 -std=c++17 examples/foreign_memory/entries.cpp -lpng -o out/entries
//     out/entries out/streams/STREAM
//
// A system on ROS takes the place of `Memory`; reading and writing stay the same. The files' world has z up and is
// right-handed, as ROS's; entries are written in evonav's, where y is up: y and z change places.

#include <png.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <map>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

using Vec = std::array<double, 3>;

struct Image {
    uint32_t width = 0, height = 0;
    std::vector<uint16_t> pixels;
};

struct Camera {
    double fx, fy, cx, cy, scale;
};

struct Pose {
    Vec position;
    double x, y, z, w;

    Vec to_world(const Vec& p) const {
        const Vec q{x, y, z};
        const auto cross = [](const Vec& a, const Vec& b) {
            return Vec{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        };
        const Vec t = cross(q, p), u = cross(q, t);
        Vec world;
        for (int i = 0; i < 3; ++i) world[i] = p[i] + 2 * (w * t[i] + u[i]) + position[i];
        return world;
    }
};

struct Box {
    std::string label;
    Vec low, high;

    double distance(const Box& other) const {
        double sum = 0;
        for (int i = 0; i < 3; ++i) sum += std::pow((low[i] + high[i] - other.low[i] - other.high[i]) / 2, 2);
        return std::sqrt(sum);
    }
};

std::string text_of(const std::string& path) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error(path + ": cannot be read");
    std::stringstream text;
    text << file.rdbuf();
    return text.str();
}

Image image_of(const std::string& path) {
    FILE* file = std::fopen(path.c_str(), "rb");
    if (file == nullptr) throw std::runtime_error(path + ": cannot be read");
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    Image image;
    std::vector<png_bytep> rows;
    if (setjmp(png_jmpbuf(png))) {
        png_destroy_read_struct(&png, &info, nullptr);
        std::fclose(file);
        throw std::runtime_error(path + ": is no PNG");
    }
    png_init_io(png, file);
    png_read_info(png, info);
    image.width = png_get_image_width(png, info);
    image.height = png_get_image_height(png, info);
    if (png_get_bit_depth(png, info) != 16 || png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY) {
        png_error(png, "expected 16 bits of one channel");
    }
    png_set_swap(png);
    image.pixels.resize(size_t(image.width) * image.height);
    for (uint32_t row = 0; row < image.height; ++row) {
        rows.push_back(reinterpret_cast<png_bytep>(image.pixels.data() + size_t(row) * image.width));
    }
    png_read_image(png, rows.data());
    png_destroy_read_struct(&png, &info, nullptr);
    std::fclose(file);
    return image;
}

// The files are evonav's own and flat, so a field is found by its name; take a JSON library for anything else.
std::string field(const std::string& json, const std::string& name, const std::string& value) {
    std::smatch match;
    if (!std::regex_search(json, match, std::regex("\"" + name + "\"\\s*:\\s*" + value))) {
        throw std::runtime_error("no `" + name + "` in " + json.substr(0, 80));
    }
    return match[1];
}

double number(const std::string& json, const std::string& name) { return std::stod(field(json, name, "([-0-9.eE+]+)")); }

std::string word(const std::string& json, const std::string& name) { return field(json, name, "\"([^\"]*)\""); }

std::vector<std::string> words(const std::string& json, const std::string& name) {
    const std::string list = field(json, name, "\\[([^\\]]*)\\]");
    const std::regex quoted("\"([^\"]*)\"");
    std::vector<std::string> found;
    for (std::sregex_iterator at(list.begin(), list.end(), quoted), end; at != end; ++at) found.push_back((*at)[1]);
    return found;
}

class Memory {
public:
    std::vector<Box> boxes;

    void observe(const Image& depth, const Image& masks, const std::vector<std::string>& labels, const Pose& pose,
                 const Camera& camera) {
        const Vec none{1e9, 1e9, 1e9};
        std::vector<Box> seen;
        for (const auto& label : labels) seen.push_back({label, none, {-1e9, -1e9, -1e9}});
        for (size_t pixel = 0; pixel < depth.pixels.size(); ++pixel) {
            const int detection = int(masks.pixels[pixel]) - 1;
            if (detection < 0 || depth.pixels[pixel] == 0) continue;
            const double z = depth.pixels[pixel] / camera.scale;
            const double col = double(pixel % depth.width), row = double(pixel / depth.width);
            const Vec point = pose.to_world({(col - camera.cx) / camera.fx * z, (row - camera.cy) / camera.fy * z, z});
            Box& box = seen.at(size_t(detection));
            for (int i = 0; i < 3; ++i) {
                box.low[i] = std::min(box.low[i], point[i]);
                box.high[i] = std::max(box.high[i], point[i]);
            }
        }
        for (const Box& box : seen) {
            if (box.low[0] > box.high[0]) continue;
            const auto is_it = [&](const Box& one) { return one.label == box.label && one.distance(box) < 0.5; };
            const auto known = std::find_if(boxes.begin(), boxes.end(), is_it);
            if (known == boxes.end()) boxes.push_back(box);
            else *known = box;
        }
    }
};

int main(int argc, char** argv) try {
    if (argc != 2) throw std::runtime_error("usage: entries FOLDER");
    const std::string folder = std::string(argv[1]) + "/";
    const std::string file = text_of(folder + "cam_params.json");
    const Camera camera{number(file, "fx"), number(file, "fy"), number(file, "cx"), number(file, "cy"),
                        number(file, "scale")};
    std::istringstream lines(text_of(folder + "frames.jsonl")), poses(text_of(folder + "groundtruth.txt"));
    std::ofstream out(folder + "entries.jsonl");
    out.precision(9);
    Memory memory;
    std::string line, row;
    for (int frame = 0; std::getline(lines, line); ++frame) {
        do {
            if (!std::getline(poses, row)) throw std::runtime_error("groundtruth.txt: fewer poses than frames");
        } while (row.empty() || row[0] == '#');
        double time;
        Pose pose;
        std::istringstream(row) >> time >> pose.position[0] >> pose.position[1] >> pose.position[2] >> pose.x >>
            pose.y >> pose.z >> pose.w;
        const Image depth = image_of(folder + word(line, "depth")), masks = image_of(folder + word(line, "masks"));
        const auto labels = words(line, "labels");
        const auto start = std::chrono::steady_clock::now();
        memory.observe(depth, masks, labels, pose, camera);
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        out << "{\"frame\": " << frame << ", \"seconds\": " << seconds.count()
            << ", \"num_bytes\": " << memory.boxes.size() * sizeof(Box) << ", \"entries\": [";
        for (size_t i = 0; i < memory.boxes.size(); ++i) {
            const Box& box = memory.boxes[i];
            Vec centre, size;
            for (int axis = 0; axis < 3; ++axis) {
                centre[axis] = (box.low[axis] + box.high[axis]) / 2;
                size[axis] = box.high[axis] - box.low[axis];
            }
            out << (i ? ", " : "") << "{\"entry_id\": " << i << ", \"label\": \"" << box.label << "\", \"centre_m\": ["
                << centre[0] << ", " << centre[2] << ", " << centre[1] << "], \"size_m\": [" << size[0] << ", "
                << size[2] << ", " << size[1] << "]}";
        }
        out << "]}\n";
    }
} catch (const std::exception& error) {
    std::cerr << "error: " << error.what() << '\n';
    return 1;
}
