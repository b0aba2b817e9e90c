// kernels.cu on a processor: each thread of the device is one here, and a warp has one lane.

#include <atomic>
#include <barrier>
#include <cmath>
#include <memory>
#include <thread>
#include <vector>

#define LANES 1
#define __global__
#define __device__ static
#define __shared__
#define __launch_bounds__(threads)
#define __syncthreads() together->arrive_and_wait()
#define __threadfence() std::atomic_thread_fence(std::memory_order_seq_cst)
#define __shfl_down_sync(mask, value, other) (value)

struct Index {
    int x;
};
static thread_local Index threadIdx, blockIdx, blockDim, gridDim;
static thread_local double* room;
static thread_local std::barrier<>* together;

static unsigned long long atomicAdd(unsigned long long* at, unsigned long long more) {
    std::this_thread::yield();
    return __atomic_fetch_add(at, more, __ATOMIC_SEQ_CST);
}
using std::fmax;
using std::fmin;

#include KERNELS

template <class Kernel>
static void launch(int blocks, int threads, Kernel kernel) {
    std::vector<std::vector<double>> rooms(blocks, std::vector<double>(2 * threads));
    std::vector<std::unique_ptr<std::barrier<>>> barriers;
    std::vector<std::thread> all;
    for (int b = 0; b < blocks; ++b) barriers.emplace_back(new std::barrier<>(threads));
    for (int b = 0; b < blocks; ++b)
        for (int t = 0; t < threads; ++t)
            all.emplace_back([&, b, t] {
                threadIdx = {t}, blockIdx = {b}, blockDim = {threads}, gridDim = {blocks};
                room = rooms[b].data(), together = barriers[b].get();
                kernel();
            });
    for (auto& one : all) one.join();
}

extern "C" void solve(
    int blocks, int threads, int rows, const int* slices, const int* columns, const double* values, int width,
    const double* inverses, const double* right, double* vectors, double* parts, Count* gate, double tolerance,
    int most, double* found) {
    double *x = vectors, *r = x + rows, *z = r + rows, *p = z + rows, *before = p + rows, *q = before + rows;
    launch(blocks, threads, [=] {
        conjugate_gradients(
            rows, slices, columns, values, width, inverses, right, x, r, z, p, before, q, parts, gate, tolerance, most,
            found);
    });
}

extern "C" void sweep(
    int blocks, int threads, int count, double h, double* x, const double* w, int triangle_colours,
    const long long* triangle_starts, const int* corners, const double* gradients, const double* area,
    const double* compliance, double* strain_lambdas, int hinge_colours, const long long* hinge_starts,
    const int* vertices, const double* rest, const double* bend_compliance, double* bend_lambdas, Count* gate) {
    launch(blocks, threads, [=] {
        sweeps(
            count, h, x, w, triangle_colours, triangle_starts, corners, gradients, area, compliance, strain_lambdas,
            hinge_colours, hinge_starts, vertices, rest, bend_compliance, bend_lambdas, gate);
    });
}
