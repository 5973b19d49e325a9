/* Dormand and Prince's method of order 8: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section
 * II.5 and their program DOP853. Each macro is a sum over the stages k of state i. */
static const double NODES[16] = {0x0.0p+0, 0x1.aee6838dae63ap-5, 0x1.432ce2aa42cacp-4, 0x1.e4c353ff64302p-4, 0x1.2068c499c08d9p-2, 0x1.5555555555555p-2,
    0x1.0000000000000p-2, 0x1.3b13b13b13b14p-2, 0x1.4d74d74d74d75p-1, 0x1.3333333333333p-1, 0x1.b6db6db6db6dbp-1, 0x1.0000000000000p+0,
    0x1.0000000000000p+0, 0x1.999999999999ap-4, 0x1.999999999999ap-3, 0x1.8e38e38e38e39p-1};
#define STAGE_1(k, i) ( \
    (0x1.aee6838dae63ap-5) * (k)[0][i])
#define STAGE_2(k, i) ( \
    (0x1.432ce2aa42cacp-6) * (k)[0][i] + (0x1.e4c353ff64302p-5) * (k)[1][i])
#define STAGE_3(k, i) ( \
    (0x1.e4c353ff64302p-6) * (k)[0][i] + (0x1.6b927eff8b241p-4) * (k)[2][i])
#define STAGE_4(k, i) ( \
    (0x1.ee50d7ecde9fap-3) * (k)[0][i] + (-0x1.c4e3ab5ad1507p-1) * (k)[2][i] + \
    (0x1.d983d7ac79ef5p-1) * (k)[3][i])
#define STAGE_5(k, i) ( \
    (0x1.2f684bda12f68p-5) * (k)[0][i] + (0x1.5ddb63bdb6d36p-3) * (k)[3][i] + \
    (0x1.00f533f66f19ap-3) * (k)[4][i])
#define STAGE_6(k, i) ( \
    (0x1.3000000000000p-5) * (k)[0][i] + (0x1.5cad30f3347edp-3) * (k)[3][i] + \
    (0x1.ed4b3c332e04dp-5) * (k)[4][i] + (-0x1.2000000000000p-6) * (k)[5][i])
#define STAGE_7(k, i) ( \
    (0x1.2fdb8fee78792p-5) * (k)[0][i] + (0x1.5cf23f6595d72p-3) * (k)[3][i] + \
    (0x1.b758640dea698p-4) * (k)[4][i] + (-0x1.f5fcc20fcd32fp-7) * (k)[5][i] + \
    (0x1.0f1d92efb0b71p-7) * (k)[6][i])
#define STAGE_8(k, i) ( \
    (0x1.3f8b78b985813p-1) * (k)[0][i] + (-0x1.ae31bacc6bc8ap+1) * (k)[3][i] + \
    (-0x1.bc873f08e11f9p-1) * (k)[4][i] + (0x1.b9793d88d1855p+4) * (k)[5][i] + \
    (0x1.42770f892ad69p+4) * (k)[6][i] + (-0x1.5beb4865c42f9p+5) * (k)[7][i])
#define STAGE_9(k, i) ( \
    (0x1.e9205e321b655p-2) * (k)[0][i] + (-0x1.3e7a8a34bd27fp+1) * (k)[3][i] + \
    (-0x1.2e3a9968c93c8p-1) * (k)[4][i] + (0x1.53ae4a6d655eep+4) * (k)[5][i] + \
    (0x1.e8ef7b5f258b8p+3) * (k)[6][i] + (-0x1.0a4e418d711b9p+5) * (k)[7][i] + \
    (-0x1.4d1b3d9b4a876p-6) * (k)[8][i])
#define STAGE_10(k, i) ( \
    (-0x1.dfd121f1d399bp-1) * (k)[0][i] + (0x1.4bed869fb0b9dp+2) * (k)[3][i] + \
    (0x1.1768702792ea9p+0) * (k)[4][i] + (-0x1.04cb0e2110c1cp+3) * (k)[5][i] + \
    (-0x1.2852305e975a8p+4) * (k)[6][i] + (0x1.6bd4f06cb863ap+4) * (k)[7][i] + \
    (0x1.3f2e777cf109dp+1) * (k)[8][i] + (-0x1.85fc60d2b572cp+1) * (k)[9][i])
#define STAGE_11(k, i) ( \
    (0x1.22fbd3b09fcdcp+1) * (k)[0][i] + (-0x1.511a963cafe55p+3) * (k)[3][i] + \
    (-0x1.001c935ac72acp+1) * (k)[4][i] + (-0x1.1f57c8eff3006p+4) * (k)[5][i] + \
    (0x1.bf2ea18b58a01p+4) * (k)[6][i] + (-0x1.6df3a7d1cec13p+1) * (k)[7][i] + \
    (-0x1.1bee71a9f33a9p+3) * (k)[8][i] + (0x1.8b89c42c81861p+3) * (k)[9][i] + \
    (0x1.496ac6253e202p-1) * (k)[10][i])
#define STAGE_13(k, i) ( \
    (0x1.cc1fca2ceb148p-5) * (k)[0][i] + (0x1.03958f21a35b8p-2) * (k)[6][i] + \
    (-0x1.f84c2c277c23ep-3) * (k)[7][i] + (-0x1.fcb02555c9defp-4) * (k)[8][i] + \
    (0x1.39f10ce2d1913p-3) * (k)[9][i] + (0x1.0cbb69b38652cp-7) * (k)[10][i] + \
    (0x1.eff840f396ba9p-8) * (k)[11][i] + (-0x1.0fe8ab4fa4830p-7) * (k)[12][i])
#define STAGE_14(k, i) ( \
    (0x1.04ca1897bdb63p-5) * (k)[0][i] + (0x1.cfae9e5f59f45p-6) * (k)[5][i] + \
    (0x1.b69db017c8cf9p-5) * (k)[6][i] + (-0x1.c1ef72fc69469p-5) * (k)[7][i] + \
    (-0x1.c6710eef6e153p-14) * (k)[10][i] + (0x1.9127a52d32320p-12) * (k)[11][i] + \
    (-0x1.6500e13e7149bp-12) * (k)[12][i] + (0x1.21686b20cd989p-3) * (k)[13][i])
#define STAGE_15(k, i) ( \
    (-0x1.b7309792b6015p-2) * (k)[0][i] + (-0x1.2ca5d44afdc9ap+2) * (k)[5][i] + \
    (0x1.ebbd2c419eda3p+2) * (k)[6][i] + (0x1.046a54457171cp+2) * (k)[7][i] + \
    (0x1.6d49e44edba44p-2) * (k)[8][i] + (-0x1.6ebeec24871d4p-10) * (k)[12][i] + \
    (0x1.79482a23f1996p+1) * (k)[13][i] + (-0x1.24d4a6dca2222p+3) * (k)[14][i])
#define SOLUTION(k, i) ( \
    (0x1.bcc6368d1177cp-5) * (k)[0][i] + (0x1.1cd1ed2ad5ae2p+2) * (k)[5][i] + \
    (0x1.e43a845d5ab9fp+0) * (k)[6][i] + (-0x1.7346ecf96af43p+2) * (k)[7][i] + \
    (0x1.3ea1df2f0eb98p-2) * (k)[8][i] + (-0x1.37a028f43b002p-3) * (k)[9][i] + \
    (0x1.9c657697fe72dp-3) * (k)[10][i] + (0x1.6e44f50ab6bc2p-5) * (k)[11][i])
#define ERROR_3(k, i) ( \
    (-0x1.84b641fbfa1f1p-3) * (k)[0][i] + (0x1.1cd1ed2ad5ae2p+2) * (k)[5][i] + \
    (0x1.e43a845d5ab9fp+0) * (k)[6][i] + (-0x1.7346ecf96af43p+2) * (k)[7][i] + \
    (-0x1.b0d3a26abb716p-2) * (k)[8][i] + (-0x1.37a028f43b002p-3) * (k)[9][i] + \
    (0x1.9c657697fe72dp-3) * (k)[10][i] + (0x1.732080ac040edp-6) * (k)[11][i])
#define ERROR_5(k, i) ( \
    (0x1.adeaea1607e1ap-7) * (k)[0][i] + (-0x1.39a3da55ab5c3p+0) * (k)[5][i] + \
    (-0x1.fba83bede8a72p-2) * (k)[6][i] + (0x1.aa149f7eda509p+0) * (k)[7][i] + \
    (-0x1.66bc9b10e7e71p-2) * (k)[8][i] + (0x1.56330d0783989p-2) * (k)[9][i] + \
    (0x1.4f8eb54a31435p-4) * (k)[10][i] + (-0x1.6e44f50ab6bc2p-6) * (k)[11][i])
#define DENSE_0(k, i) ( \
    (-0x1.0db9dcc37c81bp+3) * (k)[0][i] + (0x1.2228765f0a2ebp-1) * (k)[5][i] + \
    (-0x1.88d35a1175376p+1) * (k)[6][i] + (0x1.313cca2e462ecp+1) * (k)[7][i] + \
    (0x1.0efafd3c0d1bdp+1) * (k)[8][i] + (-0x1.be2709a4ac0d3p-1) * (k)[9][i] + \
    (0x1.1ec6a759da28bp+1) * (k)[10][i] + (0x1.435e4b2f53319p-1) * (k)[11][i] + \
    (-0x1.6c81218b7f07cp-4) * (k)[12][i] + (0x1.22604753358b4p+4) * (k)[13][i] + \
    (-0x1.263a6db60dfa1p+3) * (k)[14][i] + (-0x1.1be8052a2581dp+2) * (k)[15][i])
#define DENSE_1(k, i) ( \
    (0x1.4dae269ad44fcp+3) * (k)[0][i] + (0x1.e49125d57ed67p+7) * (k)[5][i] + \
    (0x1.4a66a19b8434bp+7) * (k)[6][i] + (-0x1.768bf81e14e35p+8) * (k)[7][i] + \
    (-0x1.61d194558cffbp+4) * (k)[8][i] + (0x1.eef08f933a023p+2) * (k)[9][i] + \
    (-0x1.eac90d122c30dp+4) * (k)[10][i] + (-0x1.2aa0d032a0acdp+3) * (k)[11][i] + \
    (0x1.f64fc65250f7cp+3) * (k)[12][i] + (-0x1.f23afedecfd53p+4) * (k)[13][i] + \
    (-0x1.2b4b2806665cap+3) * (k)[14][i] + (0x1.1e88e43070a10p+5) * (k)[15][i])
#define DENSE_2(k, i) ( \
    (0x1.3fc2c7303381fp+4) * (k)[0][i] + (-0x1.83098d10f2521p+8) * (k)[5][i] + \
    (-0x1.7a5b34edf4d39p+7) * (k)[6][i] + (0x1.07e771c2c6a0cp+9) * (k)[7][i] + \
    (-0x1.725d68dc06f96p+3) * (k)[8][i] + (0x1.b8661dd0f8bd7p+2) * (k)[9][i] + \
    (-0x1.0027a7d67fc68p+0) * (k)[10][i] + (0x1.8e308023d3331p-1) * (k)[11][i] + \
    (-0x1.639c3efff56d2p+1) * (k)[12][i] + (-0x1.e192d4f30c77fp+5) * (k)[13][i] + \
    (0x1.51481861928c0p+6) * (k)[14][i] + (0x1.7fc0d95740812p+3) * (k)[15][i])
#define DENSE_3(k, i) ( \
    (-0x1.9b1a59f97e9a3p+4) * (k)[0][i] + (-0x1.346126bd860c7p+7) * (k)[5][i] + \
    (-0x1.cf0f0ac990990p+7) * (k)[6][i] + (0x1.65a39d3b3c602p+8) * (k)[7][i] + \
    (0x1.759f0d4d83c70p+6) * (k)[8][i] + (-0x1.2baaa552107abp+5) * (k)[9][i] + \
    (0x1.a0660a855838ep+6) * (k)[10][i] + (0x1.dd71d78528cf6p+4) * (k)[11][i] + \
    (-0x1.5c4484e37f77ep+5) * (k)[12][i] + (0x1.814c57df82010p+6) * (k)[13][i] + \
    (-0x1.396b082b5cd1ep+5) * (k)[14][i] + (-0x1.2b7423e1cb30dp+7) * (k)[15][i])
