/* Every output repeats the input of its type, without a delay. */
#define STEP 0.1
typedef struct {
  double fixed, tunable, real[2];
  float single[2];
  int8_t i8; uint8_t u8; int16_t i16; uint16_t u16; int32_t i32; uint32_t u32; int64_t i64; uint64_t u64;
  bool boolean; Text text; Text text_parameter; Bytes bytes; int32_t option; int64_t option64;
} Model;
static void start(Model *m) {
  *m = (Model){.text = {"Set me!"}, .text_parameter = {"Set me!"}, .bytes = {3, "foo"}, .option = 1, .option64 = 1};
}
static void advance(Model *m, double time) { (void)m; (void)time; }
static bool event(const Model *m, double time) { (void)m; (void)time; return false; }
static void update(Model *m) { (void)m; }
static bool ended(const Model *m) { (void)m; return false; }
static size_t count(const Model *m, const void *v) { (void)m; (void)v; return 1; }
static const Variable variables[] = {
  {5, F64, PARAMETER, AT(fixed)}, {6, F64, TUNABLE, AT(tunable)},
  {1, F32, INPUT, AT(single[0])}, {2, F32, OUTPUT, AT(single[0])},
  {3, F32, INPUT, AT(single[1])}, {4, F32, OUTPUT, AT(single[1])},
  {7, F64, INPUT, AT(real[0])}, {8, F64, OUTPUT, AT(real[0])},
  {9, F64, INPUT, AT(real[1])}, {10, F64, OUTPUT, AT(real[1])},
  {11, I8, INPUT, AT(i8)}, {12, I8, OUTPUT, AT(i8)}, {13, U8, INPUT, AT(u8)}, {14, U8, OUTPUT, AT(u8)},
  {15, I16, INPUT, AT(i16)}, {16, I16, OUTPUT, AT(i16)}, {17, U16, INPUT, AT(u16)}, {18, U16, OUTPUT, AT(u16)},
  {19, I32, INPUT, AT(i32)}, {20, I32, OUTPUT, AT(i32)}, {21, U32, INPUT, AT(u32)}, {22, U32, OUTPUT, AT(u32)},
  {23, I64, INPUT, AT(i64)}, {24, I64, OUTPUT, AT(i64)}, {25, U64, INPUT, AT(u64)}, {26, U64, OUTPUT, AT(u64)},
  {27, BOOL, INPUT, AT(boolean)}, {28, BOOL, OUTPUT, AT(boolean)},
  {29, STR, INPUT, AT(text)}, {30, STR, OUTPUT, AT(text)}, {35, STR, PARAMETER, AT(text_parameter)},
  {31, BIN, INPUT, AT(bytes)}, {32, BIN, OUTPUT, AT(bytes)},
  {33, I64, INPUT, AT(option64)}, {34, I64, OUTPUT, AT(option64)},   /* the enumeration of FMI 3.0 */
  {33, I32, INPUT, AT(option)}, {34, I32, OUTPUT, AT(option)},       /* that of FMI 2.0 */
};
